#include "report/view_page.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/version.h"
#include "report/assets.h"
#include "report/json_text.h"
#include "report/png.h"
#include "report/svg.h"

namespace terrode::report {
namespace {

using recording::Frame;
using recording::FrameBody;
using recording::FrameLayout;
using recording::FrameReader;

constexpr double kLargestCode = 65535.0;

// A range in 16 bits. The step is no finer than `finest`, because digits below that only cost bytes.
struct Code {
  double low = 0.0, step = 1.0, span = 0.0;
  Code() = default;
  Code(double lo, double hi, double finest) : low(lo), step(std::max((hi - lo) / kLargestCode, finest)), span(hi - lo) {}
  std::uint16_t operator()(double v) const {
    return static_cast<std::uint16_t>(std::clamp(std::round((v - low) / step), 0.0, kLargestCode));
  }
};

// zlib stream fed piece by piece.
class Packer {
 public:
  Packer() {
    constexpr int kLevel = 6;
    if (deflateInit(&stream_, kLevel) != Z_OK) throw RunError("zlib cannot start");
  }
  ~Packer() { deflateEnd(&stream_); }
  Packer(const Packer&) = delete;
  Packer& operator=(const Packer&) = delete;

  // One frame: differences from the last one, low bytes first, then high bytes.
  void add(const std::vector<std::uint16_t>& codes) {
    last_.resize(codes.size(), 0);
    bytes_.resize(2 * codes.size());
    for (std::size_t i = 0; i < codes.size(); ++i) {
      const auto d = static_cast<std::uint16_t>(codes[i] - last_[i]);
      bytes_[i] = static_cast<unsigned char>(d & 0xFFu);
      bytes_[codes.size() + i] = static_cast<unsigned char>(d >> 8);
    }
    last_ = codes;
    run(Z_NO_FLUSH);
  }
  std::string finish() {
    bytes_.clear();
    run(Z_FINISH);
    return base64(out_);
  }

 private:
  void run(int flush) {
    stream_.next_in = bytes_.data();
    stream_.avail_in = static_cast<uInt>(bytes_.size());
    unsigned char buffer[1 << 16];
    do {
      stream_.next_out = buffer;
      stream_.avail_out = sizeof buffer;
      deflate(&stream_, flush);
      out_.append(reinterpret_cast<const char*>(buffer), sizeof buffer - stream_.avail_out);
    } while (stream_.avail_out == 0);
  }
  z_stream stream_{};
  std::vector<std::uint16_t> last_;
  std::vector<unsigned char> bytes_;
  std::string out_;
};

std::string little_endian(const std::vector<std::uint16_t>& codes) {
  std::string out;
  for (std::uint16_t c : codes) {
    out += static_cast<char>(static_cast<unsigned char>(c & 0xFFu));
    out += static_cast<char>(static_cast<unsigned char>(c >> 8));
  }
  return base64(out);
}

std::string short_number(double v) { return std::isfinite(v) ? fmt::format("{:.6g}", v) : "null"; }

std::string list(std::initializer_list<double> values) {
  std::string out = "[";
  for (double v : values) (out += out.size() > 1 ? "," : "") += short_number(v);
  return out + "]";
}

struct Limits {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
};

// "drawbar_pull" as "Drawbar pull".
std::string label(const std::string& name) {
  std::string out = name;
  std::replace(out.begin(), out.end(), '_', ' ');
  if (!out.empty() && out[0] >= 'a' && out[0] <= 'z') out[0] = static_cast<char>(out[0] - 'a' + 'A');
  return out;
}

// At most this many points of a channel are drawn; each bucket keeps its lowest and highest sample.
constexpr std::size_t kBuckets = 600;

std::string channel_json(const recording::Run& run, const recording::Channel& channel) {
  std::string times, values;
  const auto put = [&](std::size_t i) {
    times += (times.empty() ? "" : ",") + short_number(run.time[i]);
    values += (values.empty() ? "" : ",") + short_number(channel.values[i]);
  };
  const std::size_t n = std::min(run.time.size(), channel.values.size());
  if (n <= 2 * kBuckets) {
    for (std::size_t i = 0; i < n; ++i) put(i);
  } else {
    for (std::size_t b = 0; b < kBuckets; ++b) {
      const std::size_t from = b * n / kBuckets, to = (b + 1) * n / kBuckets;
      std::size_t lowest = from, highest = from;
      for (std::size_t i = from; i < to; ++i) {
        if (!(channel.values[lowest] <= channel.values[i])) lowest = i;
        if (!(channel.values[highest] >= channel.values[i])) highest = i;
      }
      put(std::min(lowest, highest));
      if (lowest != highest) put(std::max(lowest, highest));
    }
  }
  return "{\"label\":" + json_text(label(channel.name)) + ",\"unit\":" + json_text(channel.unit) + ",\"times\":[" + times +
         "],\"values\":[" + values + "]}";
}

// The channels a reader looks for first, then the others in their order; at most eight.
std::vector<const recording::Channel*> shown_channels(const recording::Run& run) {
  constexpr std::size_t kMost = 8;
  std::vector<const recording::Channel*> out;
  namespace channel = recording::channel;
  for (const char* name : {channel::drawbar_pull, channel::driving_torque, channel::sinkage, channel::normal_load})
    if (const auto* c = run.find(name)) out.push_back(c);
  for (const recording::Channel& c : run.channels)
    if (std::find(out.begin(), out.end(), &c) == out.end()) out.push_back(&c);
  std::erase_if(out, [](const recording::Channel* c) {
    return std::none_of(c->values.begin(), c->values.end(), [](double v) { return std::isfinite(v); });
  });
  if (out.size() > kMost) out.resize(kMost);
  return out;
}

ViewPage build(const FrameReader& frames, const recording::Run& series, const ViewOptions& options, std::size_t every,
               const Progress& progress) {
  const FrameLayout& layout = frames.layout();
  std::vector<std::size_t> chosen;
  for (std::size_t f = 0; f < frames.count(); f += every) chosen.push_back(f);
  if (chosen.back() + 1 != frames.count()) chosen.push_back(frames.count() - 1);

  std::size_t thin = 1;
  if (layout.ground)
    while (((layout.ground->columns - 1) / thin + 1) * ((layout.ground->rows - 1) / thin + 1) > options.ground_nodes) ++thin;
  const std::size_t columns = layout.ground ? (layout.ground->columns - 1) / thin + 1 : 0;
  const std::size_t rows = layout.ground ? (layout.ground->rows - 1) / thin + 1 : 0;
  const auto thinned = [&](const std::vector<float>& values) {
    std::vector<float> out;
    out.reserve(columns * rows);
    for (std::size_t j = 0; j < rows; ++j)
      for (std::size_t i = 0; i < columns; ++i) out.push_back(values[j * thin * layout.ground->columns + i * thin]);
    return out;
  };

  // First the ranges, then the bytes.
  Limits height, place[3];
  double pressure = 0.0;
  if (layout.ground)
    for (float v : layout.ground->undisturbed) height.add(v);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const Frame f = frames.read(chosen[k]);
    for (float v : f.height) height.add(v);
    for (float v : f.pressure) pressure = std::max(pressure, static_cast<double>(v));
    for (std::size_t i = 0; i < f.position.size(); ++i) place[i % 3].add(f.position[i]);
    if (progress.stop_requested()) throw Interrupted("stopped; nothing was written");
    progress.report(0.4 * static_cast<double>(k + 1) / static_cast<double>(chosen.size()), "reading frames");
  }
  constexpr double kFinestHeight = 5e-6;     // m: less than a grain of silt
  constexpr double kFinestPressure = 1.0;    // Pa
  constexpr double kGrainShare = 1.0 / 200.0;  // of the smallest radius: below what can be seen
  const Code height_code(height.low, height.high, kFinestHeight);
  const Code pressure_code(0.0, pressure, kFinestPressure);
  Code place_code[3];
  if (layout.particles) {
    const double finest = kGrainShare * *std::min_element(layout.particles->radius.begin(), layout.particles->radius.end());
    for (int k = 0; k < 3; ++k) place_code[k] = Code(place[k].low, place[k].high, finest);
  }

  Packer heights, pressures, positions;
  std::vector<std::string> poses(layout.bodies.size()), forces(layout.bodies.size());
  std::string times;
  std::vector<std::uint16_t> codes;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const Frame f = frames.read(chosen[k]);
    times += (k ? "," : "") + fmt::format("{:.9g}", f.time);
    for (std::size_t b = 0; b < f.bodies.size(); ++b) {
      const auto& [pose, soil] = f.bodies[b];
      poses[b] += (k ? "," : "") + list({pose.p_W.x(), pose.p_W.y(), pose.p_W.z(), pose.R_WB.w(), pose.R_WB.x(), pose.R_WB.y(), pose.R_WB.z()});
      forces[b] += (k ? "," : "") + list({soil.F_W.x(), soil.F_W.y(), soil.F_W.z()});
    }
    const auto pack = [&](Packer& packer, const std::vector<float>& values, const Code& code) {
      codes.clear();
      for (float v : thinned(values)) codes.push_back(code(v));
      packer.add(codes);
    };
    if (layout.ground) pack(heights, f.height, height_code);
    if (layout.ground && layout.ground->pressure) pack(pressures, f.pressure, pressure_code);
    if (layout.particles) {
      codes.clear();
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (std::size_t i = axis; i < f.position.size(); i += 3) codes.push_back(place_code[axis](f.position[i]));
      positions.add(codes);
    }
    if (progress.stop_requested()) throw Interrupted("stopped; nothing was written");
    progress.report(0.4 + 0.6 * static_cast<double>(k + 1) / static_cast<double>(chosen.size()), "packing frames");
  }

  std::string meta = "{\"times\":[" + times + "],\"bodies\":[";
  for (std::size_t b = 0; b < layout.bodies.size(); ++b) {
    const FrameBody& body = layout.bodies[b];
    meta += (b ? ",{\"name\":" : "{\"name\":") + json_text(body.name);
    if (body.shape == FrameBody::Shape::box)
      meta += ",\"shape\":\"box\",\"size\":" + list({body.size.x(), body.size.y(), body.size.z()});
    else if (body.shape == FrameBody::Shape::sphere)
      meta += ",\"shape\":\"sphere\",\"radius\":" + short_number(body.radius);
    else
      meta += fmt::format(",\"shape\":\"wheel\",\"radius\":{:.9g},\"width\":{:.9g},\"grouser_count\":{},\"grouser_height\":{:.9g},\"grouser_thickness\":{:.9g}",
                          body.radius, body.width, body.grouser_count, body.grouser_height, body.grouser_thickness);
    meta += ",\"poses\":[" + poses[b] + "],\"forces\":[" + forces[b] + "]}";
  }
  meta += "]";
  std::string blobs;
  const auto blob = [&](const char* name, const std::string& text) {
    blobs += fmt::format("<script type=\"text/plain\" id=\"blob-{}\">", name) + text + "</script>\n";
  };
  if (layout.ground) {
    meta += fmt::format(",\"ground\":{{\"x0\":{:.9g},\"y0\":{:.9g},\"spacing\":{:.9g},\"columns\":{},\"rows\":{},"
                        "\"height\":{{\"low\":{:.9g},\"step\":{:.9g},\"span\":{:.9g}}}",
                        layout.ground->x0, layout.ground->y0, layout.ground->spacing * static_cast<double>(thin), columns, rows,
                        height_code.low, height_code.step, height_code.span);
    if (layout.ground->pressure) meta += fmt::format(",\"pressure\":{{\"step\":{:.9g},\"high\":{:.9g}}}", pressure_code.step, pressure);
    meta += "}";
    codes.clear();
    for (float v : thinned(layout.ground->undisturbed)) codes.push_back(height_code(v));
    blob("undisturbed", little_endian(codes));
    blob("height", heights.finish());
    if (layout.ground->pressure) blob("pressure", pressures.finish());
  }
  if (layout.particles) {
    const auto three = [&](auto value) { return fmt::format("[{:.9g},{:.9g},{:.9g}]", value(0), value(1), value(2)); };
    meta += fmt::format(",\"particles\":{{\"count\":{},\"low\":{},\"step\":{},\"span\":{}}}", layout.particles->radius.size(),
                        three([&](int k) { return place_code[k].low; }), three([&](int k) { return place_code[k].step; }),
                        three([&](int k) { return place_code[k].span; }));
    std::string bytes(4 * layout.particles->radius.size(), '\0');
    static_assert(std::numeric_limits<float>::is_iec559);
    std::memcpy(bytes.data(), layout.particles->radius.data(), bytes.size());
    blob("radius", base64(bytes));
    blob("position", positions.finish());
  }
  meta += ",\"channels\":[";
  const auto channels = shown_channels(series);
  for (std::size_t i = 0; i < channels.size(); ++i) meta += (i ? "," : "") + channel_json(series, *channels[i]);
  meta += "]}";

  ViewPage page;
  page.frames = chosen.size();
  page.every = every;
  page.height_step = layout.ground ? height_code.step : 0.0;
  page.position_step = layout.particles ? std::max({place_code[0].step, place_code[1].step, place_code[2].step}) : 0.0;

  std::string& out = page.html;
  out = "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
        "script-src 'unsafe-inline'; img-src data:\">\n";
  out += fmt::format("<meta name=\"generator\" content=\"terrode {}\">\n<title>{}</title>\n<style>\n", escape(version()), escape(options.title));
  out += assets::page_css();
  out += assets::viewer_css();
  out += "</style>\n</head>\n<body>\n<div class=\"bar\"><h1>" + escape(options.title) + "</h1>";
  if (layout.ground) {
    out += "<label>Ground <select id=\"ground-by\"><option value=\"sinkage\">sinkage</option>";
    if (layout.ground->pressure) out += "<option value=\"pressure\">pressure</option>";
    out += "</select></label>";
  }
  if (layout.particles)
    out += "<label>Particles <select id=\"grains-by\"><option value=\"speed\">speed</option><option value=\"size\">size</option></select></label>";
  out += "<label>View <select id=\"look\"><option value=\"oblique\">oblique</option><option value=\"side\">side</option><option value=\"front\">front</option><option value=\"top\">top</option></select></label>";
  out += std::string("<label") + (layout.bodies.empty() ? " hidden" : "") + "><input type=\"checkbox\" id=\"forces\" checked> forces</label>";
  out += std::string("<label") + (layout.bodies.empty() ? " hidden" : "") + "><input type=\"checkbox\" id=\"follow\"> follow</label>";
  out += R"(<button class="theme" type="button" title="Light or dark" aria-label="Light or dark"><svg viewBox="0 0 24 24" fill="none" stroke="currentColor" stroke-width="2"><circle cx="12" cy="12" r="9"/><path d="M12 3a9 9 0 0 1 0 18z" fill="currentColor"/></svg></button></div>)";
  out += "\n<div class=\"stage\" id=\"stage\"><canvas id=\"view\" aria-label=\"The run in three dimensions: drag to turn, "
         "scroll to come nearer, drag with the right button to shift\"></canvas><div class=\"legend\" id=\"legend\"></div>"
         "<div class=\"message\" id=\"message\">This page needs JavaScript.</div></div>\n"
         "<div class=\"transport\"><button class=\"play\" id=\"play\" type=\"button\" title=\"Play\"></button>"
         "<input type=\"range\" id=\"time\" aria-label=\"Time\"><span class=\"clock\" id=\"clock\"></span>"
         "<select id=\"speed\" aria-label=\"Speed\"><option value=\"0.1\">0.1×</option><option value=\"0.25\">0.25×</option>"
         "<option value=\"1\" selected>1×</option><option value=\"4\">4×</option><option value=\"10\">10×</option></select></div>\n";
  if (every > 1 || thin > 1) {
    out += "<p class=\"note\">Shown:";
    if (every > 1) out += fmt::format(" one frame in {} ({} of {}).", every, chosen.size(), frames.count());
    if (thin > 1) out += fmt::format(" One node in {} along each side of the ground.", thin);
    out += " The result file has all.</p>\n";
  }
  out += "<div class=\"channels\" id=\"channels\"></div>\n";
  out += "<script type=\"application/json\" id=\"meta\">" + meta + "</script>\n" + blobs + "<script>\n";
  out += assets::viewer_js();
  out += "</script>\n</body>\n</html>\n";
  return page;
}

}  // namespace

ViewPage view_page(const FrameReader& frames, const recording::Run& series, const ViewOptions& options, const Progress& progress) {
  if (frames.count() == 0) throw InputError("the run has no frames");
  for (std::size_t every = 1;; every *= 2) {
    ViewPage page = build(frames, series, options, every, progress);
    if (page.html.size() <= options.largest || page.frames <= 2) return page;
  }
}

}  // namespace terrode::report
