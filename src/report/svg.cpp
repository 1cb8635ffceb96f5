#include "report/svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>

#include "core/problem.h"
#include "report/palette.h"
#include "report/png.h"

namespace terrode::report {
namespace {

constexpr double kFont = 13.0;
constexpr double kCharacter = 0.57;  // mean width of a character over the font size, sans-serif
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

size_t characters(const std::string& text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

double text_width(const std::string& text, double font = kFont) {
  return static_cast<double>(characters(text)) * font * kCharacter;
}

// A coordinate: two decimals are finer than any screen or press.
std::string px(double v) {
  std::string s = fmt::format("{:.2f}", v);
  s.erase(s.find_last_not_of('0') + 1);
  if (s.back() == '.') s.pop_back();
  return s == "-0" ? "0" : s;
}

// Paint as a class (for style sheets) and as an attribute (for programs that read no style sheets).
std::string paint(const char* property, int colour) {
  const char prefix = property[0];  // s of stroke, f of fill
  if (colour == kInk) return fmt::format(R"(class="{}i" {}="{}")", prefix, property, palette::kInkLight);
  const size_t i = static_cast<size_t>(colour) % palette::kLight.size();
  return fmt::format(R"(class="{}{}" {}="{}")", prefix, i, property, palette::kLight[i]);
}
std::string stroke(int colour) { return paint("stroke", colour); }
std::string fill(int colour) { return paint("fill", colour); }
const std::string kGridStroke = fmt::format(R"(class="sg" stroke="{}")", palette::kGridLight);
const std::string kMutedStroke = fmt::format(R"(class="sm" stroke="{}")", palette::kMutedLight);
const std::string kMutedFill = fmt::format(R"(class="fm" fill="{}")", palette::kMutedLight);
const std::string kInkFill = fmt::format(R"(class="fi" fill="{}")", palette::kInkLight);

std::string head(int width, int height, const std::string& name, const SvgOptions& options, const std::string& extra) {
  std::string out = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" role="img" font-family="system-ui, 'Segoe UI', 'Liberation Sans', Arial, sans-serif" font-size="{2}"{3}>)",
      width, height, px(kFont), extra);
  out += "<title>" + escape(name) + "</title>";
  if (options.standalone) {
    out += "<style>@media (prefers-color-scheme:dark){";
    for (size_t i = 0; i < palette::kDark.size(); ++i)
      out += fmt::format(".s{0}{{stroke:{1}}}.f{0}{{fill:{1}}}", i, palette::kDark[i]);
    out += fmt::format(".si{{stroke:{0}}}.fi{{fill:{0}}}.sm{{stroke:{1}}}.fm{{fill:{1}}}.sg{{stroke:{2}}}.bg{{fill:{3}}}",
                       palette::kInkDark, palette::kMutedDark, palette::kGridDark, palette::kGroundDark);
    out += "}</style>";
    out += fmt::format(R"(<rect class="bg" width="{}" height="{}" fill="{}"/>)", width, height, palette::kGroundLight);
  }
  return out;
}

std::string label_text(const Axis& axis) {
  if (axis.unit.empty()) return axis.label;
  return axis.label + " [" + axis.unit + "]";
}

std::string superscript(int n) {
  static const char* digits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string out;
  for (char c : std::to_string(n)) out += c == '-' ? "⁻" : digits[c - '0'];
  return out;
}

// Takes values of an axis to pixels.
struct Scale {
  double lo = 0.0, hi = 1.0, from = 0.0, to = 1.0;
  bool log = false;
  double place(double v) const {
    if (log && v <= 0.0) return kNaN;
    const double a = log ? std::log10(v) : v;
    const double l = log ? std::log10(lo) : lo, h = log ? std::log10(hi) : hi;
    return from + (a - l) / (h - l) * (to - from);
  }
  std::vector<double> ticks(int target) const {
    if (!log) return nice_ticks(lo, hi, target);
    std::vector<double> out;
    const int first = static_cast<int>(std::floor(std::log10(lo))), last = static_cast<int>(std::ceil(std::log10(hi)));
    const int step = std::max(1, (last - first + target - 1) / std::max(target, 1));
    for (int e = first; e <= last; e += step)
      for (double m : {1.0, 2.0, 5.0}) {
        if (m > 1.0 && last - first > 2) continue;
        const double v = m * std::pow(10.0, e);
        if (v >= lo * (1.0 - 1e-9) && v <= hi * (1.0 + 1e-9)) out.push_back(v);
      }
    return out.size() < 2 ? nice_ticks(lo, hi, target) : out;
  }
};

// Labels with as many decimals as the step needs, so that a column of ticks is of one form.
std::vector<std::string> tick_labels(const std::vector<double>& ticks, bool log) {
  std::vector<std::string> out;
  double step = 0.0, largest = 0.0;
  for (size_t i = 0; i < ticks.size(); ++i) {
    largest = std::max(largest, std::abs(ticks[i]));
    if (i > 0) step = step == 0.0 ? ticks[i] - ticks[i - 1] : std::min(step, ticks[i] - ticks[i - 1]);
  }
  for (double t : ticks) {
    if (log && (largest >= 1e4 || ticks.front() < 1e-3)) {
      const int e = static_cast<int>(std::floor(std::log10(t) + 1e-9));
      const double m = t / std::pow(10.0, e);
      out.push_back((std::abs(m - 1.0) < 1e-6 ? std::string() : format_number(m) + "·") + "10" + superscript(e));
    } else if (log || largest >= 1e6 || (step > 0.0 && step < 1e-4)) {
      out.push_back(format_number(std::abs(t) < 1e-12 * largest ? 0.0 : t));
    } else {
      const int decimals = step > 0.0 ? std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9))) : 2;
      std::string s = fmt::format("{:.{}f}", std::abs(t) < 1e-9 * largest ? 0.0 : t, decimals);
      out.push_back(s[0] == '-' ? std::string("−").append(s, 1) : s);
    }
  }
  return out;
}

struct Range {
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  void add(double v, bool positive_only) {
    if (!std::isfinite(v) || (positive_only && v <= 0.0)) return;
    lo = std::min(lo, v);
    hi = std::max(hi, v);
  }
  bool empty() const { return lo > hi; }
};

void check(const Figure& figure) {
  Problems problems;
  for (const Series& s : figure.series) {
    const std::string key = "figure \"" + figure.title + "\", series \"" + s.name + "\"";
    const bool band = s.draw == Draw::band;
    const auto wrong = [&](const char* what, size_t n) {
      problems.push_back({{}, 0, 0, key, fmt::format("has {} values of {} for {} of x", n, what, s.x.size()), "as many"});
    };
    if (!(band && s.y.empty()) && s.y.size() != s.x.size()) wrong("y", s.y.size());
    if (!(s.low.empty() && !band) && s.low.size() != s.x.size()) wrong("low", s.low.size());
    if (!(s.high.empty() && !band) && s.high.size() != s.x.size()) wrong("high", s.high.size());
  }
  throw_if_any(problems);
}

// Range of an axis: what the data cover with a margin, or what the caller asked for.
std::pair<double, double> limits(const Figure& figure, const Axis& axis, bool is_x) {
  Range range;
  for (const Series& s : figure.series) {
    if (is_x) {
      for (double v : s.x) range.add(v, axis.log);
    } else {
      for (const auto* values : {&s.y, &s.low, &s.high})
        for (double v : *values) range.add(v, axis.log);
    }
  }
  for (const Annotation& a : figure.annotations) range.add(is_x ? a.x : a.y, axis.log);
  if (range.empty()) {
    if (axis.log)
      throw InputError("figure \"" + figure.title + "\": axis \"" + axis.label + "\" is logarithmic, no value is above 0");
    range.lo = 0.0, range.hi = 1.0;
  }
  double lo = range.lo, hi = range.hi;
  if (axis.log) {
    const double margin = std::max(std::pow(hi / lo, 0.03), 1.02);
    lo /= margin, hi *= margin;
  } else {
    if (hi - lo <= 1e-12 * std::max(std::abs(hi), std::abs(lo))) {
      const double half = hi == 0.0 ? 1.0 : 0.1 * std::abs(hi);
      lo -= half, hi += half;
    }
    const double margin = (is_x ? 0.025 : 0.06) * (hi - lo);
    // An axis of magnitudes starts at its zero where that costs little room.
    const bool from_zero = !is_x && lo >= 0.0 && lo < 0.35 * hi;
    lo = from_zero ? 0.0 : lo - margin;
    hi += margin;
  }
  if (std::isfinite(axis.min)) lo = axis.min;
  if (std::isfinite(axis.max)) hi = axis.max;
  if (!(hi > lo) || (axis.log && lo <= 0.0))
    throw InputError("figure \"" + figure.title + "\": axis \"" + axis.label + "\" has no room between its limits");
  return {lo, hi};
}

std::string marker(int shape, double x, double y, int colour, double size = 4.0) {
  switch (shape % 4) {
    case 1: {
      const double a = size * 0.9;
      return fmt::format(R"(<rect x="{}" y="{}" width="{}" height="{}" {}/>)", px(x - a), px(y - a), px(2 * a), px(2 * a),
                         fill(colour));
    }
    case 2:
      return fmt::format(R"(<path d="M{} {}l{} {}h{}z" {}/>)", px(x), px(y - 1.2 * size), px(1.15 * size), px(2.0 * size),
                         px(-2.3 * size), fill(colour));
    case 3:
      return fmt::format(R"(<path d="M{} {}l{} {}l{} {}l{} {}z" {}/>)", px(x), px(y - 1.3 * size), px(1.3 * size),
                         px(1.3 * size), px(-1.3 * size), px(1.3 * size), px(-1.3 * size), px(-1.3 * size), fill(colour));
    default:
      return fmt::format(R"(<circle cx="{}" cy="{}" r="{}" {}/>)", px(x), px(y), px(size), fill(colour));
  }
}

bool increasing(const std::vector<double>& v) { return std::is_sorted(v.begin(), v.end()); }

// The path of a line. Where more points fall into a pixel column than a screen can show, each column keeps its first,
// lowest, highest and last point, which draws the same picture.
std::string line_path(const Series& s, const Scale& sx, const Scale& sy, bool steps) {
  struct Point {
    double x, y;
  };
  std::vector<std::vector<Point>> parts(1);
  for (size_t i = 0; i < s.x.size(); ++i) {
    const Point p{sx.place(s.x[i]), sy.place(s.y[i])};
    if (!std::isfinite(p.x) || !std::isfinite(p.y)) {
      if (!parts.back().empty()) parts.emplace_back();
      continue;
    }
    if (steps && !parts.back().empty()) parts.back().push_back({p.x, parts.back().back().y});
    parts.back().push_back(p);
  }
  std::string d;
  const bool thin_out = increasing(s.x) && static_cast<double>(s.x.size()) > 6.0 * (sx.to - sx.from);
  for (const auto& part : parts) {
    if (part.empty()) continue;
    bool first = true;
    const auto put = [&](const Point& p) {
      d += (first ? 'M' : 'L') + px(p.x) + " " + px(p.y);
      first = false;
    };
    if (!thin_out) {
      for (const Point& p : part) put(p);
      continue;
    }
    for (size_t i = 0; i < part.size();) {
      const double column = std::floor(part[i].x);
      size_t end = i, lowest = i, highest = i;
      for (; end < part.size() && std::floor(part[end].x) == column; ++end) {
        if (part[end].y < part[lowest].y) lowest = end;
        if (part[end].y > part[highest].y) highest = end;
      }
      size_t keep[] = {i, std::min(lowest, highest), std::max(lowest, highest), end - 1};
      size_t last = part.size();
      for (size_t k : keep) {
        if (k != last) put(part[k]);
        last = k;
      }
      i = end;
    }
  }
  return d;
}

std::string band_path(const Series& s, const Scale& sx, const Scale& sy) {
  std::string d;
  for (size_t i = 0; i < s.x.size();) {
    size_t end = i;
    const auto usable = [&](size_t k) {
      return std::isfinite(sx.place(s.x[k])) && std::isfinite(sy.place(s.low[k])) && std::isfinite(sy.place(s.high[k]));
    };
    while (end < s.x.size() && usable(end)) ++end;
    if (end > i + 1) {
      for (size_t k = i; k < end; ++k) d += (k == i ? 'M' : 'L') + px(sx.place(s.x[k])) + " " + px(sy.place(s.high[k]));
      for (size_t k = end; k-- > i;) d += 'L' + px(sx.place(s.x[k])) + " " + px(sy.place(s.low[k]));
      d += 'z';
    }
    i = std::max(end, i + 1);
  }
  return d;
}

struct Frame {
  double left, right, top, bottom;
};

// Axes with grid, tick labels and names.
std::string axes(const Frame& f, const Scale& sx, const Scale& sy, const Axis& x, const Axis& y,
                 const std::vector<double>& x_ticks, const std::vector<std::string>& x_labels,
                 const std::vector<double>& y_ticks, const std::vector<std::string>& y_labels) {
  std::string out = "<g>";
  for (double t : x_ticks)
    out += fmt::format(R"(<path d="M{0} {1}V{2}" {3}/>)", px(sx.place(t)), px(f.top), px(f.bottom), kGridStroke);
  for (double t : y_ticks)
    out += fmt::format(R"(<path d="M{0} {1}H{2}" {3}/>)", px(f.left), px(sy.place(t)), px(f.right), kGridStroke);
  if (!sy.log && sy.lo < 0.0 && sy.hi > 0.0)
    out += fmt::format(R"(<path d="M{} {}H{}" {} stroke-width="1"/>)", px(f.left), px(sy.place(0.0)), px(f.right), kMutedStroke);
  out += fmt::format(R"(<path d="M{} {}H{}" {}/>)", px(f.left), px(f.bottom), px(f.right), kMutedStroke);
  out += R"(</g><g text-anchor="middle">)";
  for (size_t i = 0; i < x_ticks.size(); ++i)
    out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(sx.place(x_ticks[i])), px(f.bottom + 18.0), kMutedFill,
                       escape(x_labels[i]));
  out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(0.5 * (f.left + f.right)), px(f.bottom + 39.0), kInkFill,
                     escape(label_text(x)));
  out += R"(</g><g text-anchor="end">)";
  for (size_t i = 0; i < y_ticks.size(); ++i)
    out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(f.left - 7.0), px(sy.place(y_ticks[i]) + 4.5), kMutedFill,
                       escape(y_labels[i]));
  out += "</g>";
  out += fmt::format(R"(<text transform='translate({} {}) rotate(-90)' text-anchor="middle" {}>{}</text>)", px(kFont + 1.0),
                     px(0.5 * (f.top + f.bottom)), kInkFill, escape(label_text(y)));
  return out;
}

double widest(const std::vector<std::string>& labels) {
  double w = 0.0;
  for (const auto& l : labels) w = std::max(w, text_width(l));
  return w;
}

std::string title_text(const std::string& title, double left) {
  return fmt::format(R"(<text x="{}" y="22" font-weight="600" font-size="15" {}>{}</text>)", px(left), kInkFill, escape(title));
}

void write_text(const std::string& text, const std::filesystem::path& path) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw RunError("cannot write " + path.string());
}

}  // namespace

std::vector<double> nice_ticks(double lo, double hi, int target) {
  if (!(hi > lo) || target < 1) return {lo};
  const double raw = (hi - lo) / target;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  double step = 10.0 * power;
  for (double m : {1.0, 2.0, 5.0})
    if (m * power >= raw * (1.0 - 1e-9)) {
      step = m * power;
      break;
    }
  std::vector<double> out;
  const double slack = 1e-9 * (hi - lo);
  const auto first = static_cast<std::int64_t>(std::ceil((lo - slack) / step));
  const auto last = static_cast<std::int64_t>(std::floor((hi + slack) / step));
  for (std::int64_t i = first; i <= last; ++i) out.push_back(static_cast<double>(i) * step);
  return out;
}

std::string format_number(double value, int digits) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return value > 0 ? "∞" : "−∞";
  if (value == 0.0) return "0";
  digits = std::clamp(digits, 1, 17);
  std::string s = fmt::format("{:.{}e}", std::abs(value), digits - 1);
  const auto at = s.find('e');
  const int exponent = std::stoi(s.substr(at + 1));
  if (exponent < -4 || exponent >= std::max(digits, 6)) {
    s.erase(at);
    if (s.find('.') != std::string::npos) {
      s.erase(s.find_last_not_of('0') + 1);
      if (s.back() == '.') s.pop_back();
    }
    s += fmt::format("e{}{}", exponent < 0 ? "−" : "", std::abs(exponent));
  } else {
    // Digits before the point are never replaced by zeros.
    s = fmt::format("{:.{}f}", exponent < digits ? std::stod(s) : std::abs(value), std::max(0, digits - 1 - exponent));
    if (s.find('.') != std::string::npos) {
      s.erase(s.find_last_not_of('0') + 1);
      if (s.back() == '.') s.pop_back();
    }
  }
  return value < 0 ? fmt::format("−{}", s) : s;
}

std::string escape(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (char c : text) switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      case '\'': out += "&#39;"; break;
      default:
        // Control characters have no place in XML and would make the drawing unreadable.
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') out += c;
    }
  return out;
}

std::string svg(const Figure& figure, const SvgOptions& options) {
  check(figure);
  const auto [x_lo, x_hi] = limits(figure, figure.x, true);
  const auto [y_lo, y_hi] = limits(figure, figure.y, false);

  // Legend: rows of entries above the plot, where there is more than one series or the one has a name.
  std::vector<size_t> entries;
  for (size_t i = 0; i < figure.series.size(); ++i)
    if (!figure.series[i].name.empty()) entries.push_back(i);

  Frame f{};
  f.right = figure.width - 18.0;
  f.top = options.standalone && !figure.title.empty() ? 42.0 : 14.0;
  f.bottom = figure.height - 50.0;
  Scale sy{y_lo, y_hi, f.bottom, f.top, figure.y.log};
  const int y_target = std::max(2, static_cast<int>((f.bottom - f.top) / 55.0));
  const auto y_ticks = sy.ticks(y_target);
  const auto y_labels = tick_labels(y_ticks, figure.y.log);
  f.left = 34.0 + widest(y_labels);

  double pen_x = f.left, pen_y = f.top + 2.0;
  std::vector<std::pair<double, double>> places;
  for (size_t i : entries) {
    const double w = 30.0 + text_width(figure.series[i].name) + 16.0;
    if (pen_x > f.left && pen_x + w > f.right + 16.0) pen_x = f.left, pen_y += 19.0;
    places.emplace_back(pen_x, pen_y);
    pen_x += w;
  }
  if (!entries.empty()) f.top = pen_y + 16.0;
  if (f.bottom - f.top < 40.0)
    throw InputError("figure \"" + figure.title + "\" is too small for its legend: make it higher");
  sy.to = f.top;
  const Scale sx{x_lo, x_hi, f.left, f.right, figure.x.log};
  auto x_ticks = sx.ticks(std::max(2, static_cast<int>((f.right - f.left) / 75.0)));
  auto x_labels = tick_labels(x_ticks, figure.x.log);
  while (x_ticks.size() > 2 && widest(x_labels) + 10.0 > (f.right - f.left) / static_cast<double>(x_ticks.size())) {
    std::vector<double> fewer;
    for (size_t i = 0; i < x_ticks.size(); i += 2) fewer.push_back(x_ticks[i]);
    x_ticks = fewer;
    x_labels = tick_labels(x_ticks, figure.x.log);
  }

  std::string out = head(figure.width, figure.height, figure.title, options, "");
  if (options.standalone && !figure.title.empty()) out += title_text(figure.title, f.left);
  out += axes(f, sx, sy, figure.x, figure.y, x_ticks, x_labels, y_ticks, y_labels);
  out += fmt::format(R"(<clipPath id="{}-clip"><rect x="{}" y="{}" width="{}" height="{}"/></clipPath><g clip-path='url(#{}-clip)' fill="none" stroke-width="2" stroke-linejoin="round" stroke-linecap="round">)",
                     escape(options.id), px(f.left - 5), px(f.top - 5), px(f.right - f.left + 10), px(f.bottom - f.top + 10),
                     escape(options.id));

  std::vector<int> colours(figure.series.size());
  int next = 0;
  for (size_t i = 0; i < figure.series.size(); ++i)
    colours[i] = figure.series[i].colour == kNextColour ? next++ : figure.series[i].colour;

  for (size_t i = 0; i < figure.series.size(); ++i) {
    const Series& s = figure.series[i];
    if (s.draw == Draw::band)
      out += fmt::format(R"(<path d="{}" {} fill-opacity="0.18" stroke="none"/>)", band_path(s, sx, sy), fill(colours[i]));
  }
  for (size_t i = 0; i < figure.series.size(); ++i) {
    const Series& s = figure.series[i];
    if (s.draw == Draw::line || s.draw == Draw::line_and_points || s.draw == Draw::steps)
      out += fmt::format(R"(<path d="{}" {}{}/>)", line_path(s, sx, sy, s.draw == Draw::steps), stroke(colours[i]),
                         s.dashed ? R"( stroke-dasharray="7 5")" : "");
    if (s.draw != Draw::band && !s.low.empty() && !s.high.empty())
      for (size_t k = 0; k < s.x.size(); ++k) {
        const double x = sx.place(s.x[k]), lo = sy.place(s.low[k]), hi = sy.place(s.high[k]);
        if (!std::isfinite(x) || !std::isfinite(lo) || !std::isfinite(hi)) continue;
        out += fmt::format(R"(<path d="M{1} {2}V{3}M{4} {2}h8M{4} {3}h8" {0} stroke-width="1.3"/>)", stroke(colours[i]), px(x),
                           px(lo), px(hi), px(x - 4));
      }
    if (s.draw == Draw::points || s.draw == Draw::line_and_points)
      for (size_t k = 0; k < s.x.size(); ++k) {
        const double x = sx.place(s.x[k]), y = sy.place(s.y[k]);
        if (std::isfinite(x) && std::isfinite(y))
          out += marker(colours[i] == kInk ? 0 : colours[i] + 1, x, y, colours[i], s.x.size() > 300 ? 1.6 : 4.0);
      }
  }
  out += "</g>";
  for (const Annotation& a : figure.annotations) {
    const bool has_x = std::isfinite(a.x), has_y = std::isfinite(a.y);
    const double x = has_x ? sx.place(a.x) : f.right, y = has_y ? sy.place(a.y) : f.top + 12.0;
    if (has_x != has_y)
      out += fmt::format(R"(<path d="{}" {} stroke-dasharray="3 4"/>)",
                         has_x ? fmt::format("M{} {}V{}", px(x), px(f.top), px(f.bottom))
                               : fmt::format("M{} {}H{}", px(f.left), px(y), px(f.right)),
                         kMutedStroke);
    const bool left_of = !has_x || x + text_width(a.text, 12.0) + 8.0 > f.right;
    out += fmt::format(R"(<text x="{}" y="{}" font-size="12" text-anchor="{}" {}>{}</text>)", px(left_of ? x - 6 : x + 6),
                       px(y - 5), left_of ? "end" : "start", kMutedFill, escape(a.text));
  }
  for (size_t e = 0; e < entries.size(); ++e) {
    const Series& s = figure.series[entries[e]];
    const int colour = colours[entries[e]];
    const auto [x, y] = places[e];
    if (s.draw == Draw::band)
      out += fmt::format(R"(<rect x="{}" y="{}" width="22" height="10" {} fill-opacity="0.3"/>)", px(x), px(y - 9), fill(colour));
    else if (s.draw != Draw::points)
      out += fmt::format(R"(<path d="M{} {}h22" {} stroke-width="2"{}/>)", px(x), px(y - 4), stroke(colour),
                         s.dashed ? R"( stroke-dasharray="7 5")" : "");
    if (s.draw == Draw::points || s.draw == Draw::line_and_points)
      out += marker(colour == kInk ? 0 : colour + 1, x + 11, y - 4, colour);
    out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(x + 28), px(y), kInkFill, escape(s.name));
  }
  return out + "</svg>\n";
}

std::string svg(const HeatMap& map, const SvgOptions& options) {
  const size_t columns = map.columns(), rows = map.rows();
  const bool bottom_up = map.y_names.empty();
  if (columns == 0 || rows == 0 || map.values.size() != columns * rows)
    throw InputError(fmt::format("map \"{}\" has {} values for {} columns and {} rows", map.title, map.values.size(), columns, rows));
  Range range;
  for (double v : map.values) range.add(v, false);
  if (range.empty()) range.lo = 0.0, range.hi = 1.0;
  if (map.diverging) {
    const double m = std::max({std::abs(range.lo), std::abs(range.hi), 1e-300});
    range.lo = -m, range.hi = m;
  }
  if (range.hi <= range.lo) range.hi = range.lo + 1.0;
  const auto colour = [&](double v) {
    return map.diverging ? palette::diverging(v / range.hi) : palette::sequential((v - range.lo) / (range.hi - range.lo));
  };

  Frame f{};
  f.top = options.standalone && !map.title.empty() ? 42.0 : 14.0;
  f.bottom = map.height - 50.0;
  const auto edges = [](const std::vector<double>& centres) {
    if (centres.size() < 2) return std::pair{centres[0] - 0.5, centres[0] + 0.5};
    const double half = 0.5 * (centres.back() - centres.front()) / static_cast<double>(centres.size() - 1);
    return std::pair{centres.front() - half, centres.back() + half};
  };
  Scale sx, sy;
  std::vector<double> x_ticks, y_ticks;
  std::vector<std::string> x_labels, y_labels;
  if (bottom_up) {
    std::tie(sy.lo, sy.hi) = edges(map.y_values);
    sy.from = f.bottom, sy.to = f.top;
    y_ticks = sy.ticks(std::max(2, static_cast<int>((f.bottom - f.top) / 55.0)));
    y_labels = tick_labels(y_ticks, false);
  } else {
    sy.lo = 0.0, sy.hi = static_cast<double>(rows), sy.from = f.top, sy.to = f.bottom;
    for (size_t r = 0; r < rows; ++r) y_ticks.push_back(static_cast<double>(r) + 0.5);
    y_labels = map.y_names;
  }
  f.left = 34.0 + widest(y_labels);
  const Scale bar{range.lo, range.hi, f.bottom, f.top, false};
  const auto bar_ticks = bar.ticks(5);
  const auto bar_labels = tick_labels(bar_ticks, false);
  f.right = map.width - 62.0 - widest(bar_labels);
  sx.from = f.left, sx.to = f.right;
  if (map.x_names.empty()) {
    std::tie(sx.lo, sx.hi) = edges(map.x_values);
    x_ticks = sx.ticks(std::max(2, static_cast<int>((f.right - f.left) / 75.0)));
    x_labels = tick_labels(x_ticks, false);
  } else {
    sx.lo = 0.0, sx.hi = static_cast<double>(columns);
    for (size_t c = 0; c < columns; ++c) x_ticks.push_back(static_cast<double>(c) + 0.5);
    x_labels = map.x_names;
  }
  const bool slanted = !map.x_names.empty() && widest(x_labels) + 6.0 > (f.right - f.left) / static_cast<double>(columns);
  if (slanted) {
    const double drop = std::min(0.45 * widest(x_labels), 90.0);
    f.bottom -= drop;
    (bottom_up ? sy.from : sy.to) = f.bottom;
  }

  std::string out = head(map.width, map.height, map.title, options,
                         fmt::format(R"( data-plot="{} {} {} {}")", px(f.left), px(f.top), px(f.right), px(f.bottom)));
  if (options.standalone && !map.title.empty()) out += title_text(map.title, f.left);
  const double w = (f.right - f.left) / static_cast<double>(columns), h = (f.bottom - f.top) / static_cast<double>(rows);
  const auto top_of = [&](size_t row) {
    return f.top + h * static_cast<double>(bottom_up ? rows - 1 - row : row);
  };
  constexpr size_t kMostRectangles = 2000;
  if (columns * rows <= kMostRectangles) {
    out += R"(<g shape-rendering="crispEdges">)";
    for (size_t r = 0; r < rows; ++r)
      for (size_t c = 0; c < columns; ++c) {
        const double v = map.values[r * columns + c];
        if (std::isfinite(v))
          out += fmt::format(R"(<rect x="{}" y="{}" width="{}" height="{}" fill="{}"/>)", px(f.left + w * static_cast<double>(c)),
                             px(top_of(r)), px(w), px(h), colour(v).hex());
      }
    out += "</g>";
  } else {
    std::vector<palette::Rgb> colours(columns * rows);
    std::vector<bool> filled(columns * rows);
    for (size_t r = 0; r < rows; ++r)
      for (size_t c = 0; c < columns; ++c) {
        const double v = map.values[r * columns + c];
        const size_t at = (bottom_up ? rows - 1 - r : r) * columns + c;
        filled[at] = std::isfinite(v);
        if (filled[at]) colours[at] = colour(v);
      }
    out += fmt::format(R"(<image x="{}" y="{}" width="{}" height="{}" preserveAspectRatio="none" style="image-rendering:pixelated" href="data:image/png;base64,{}"/>)",
                       px(f.left), px(f.top), px(f.right - f.left), px(f.bottom - f.top), png_base64(columns, rows, colours, filled));
  }
  if (map.print_values)
    for (size_t r = 0; r < rows; ++r)
      for (size_t c = 0; c < columns; ++c) {
        const double v = map.values[r * columns + c];
        if (!std::isfinite(v)) continue;
        out += fmt::format(R"(<text x="{}" y="{}" font-size="12" text-anchor="middle" fill="{}">{}</text>)",
                           px(f.left + w * (static_cast<double>(c) + 0.5)), px(top_of(r) + 0.5 * h + 4.0),
                           colour(v).is_dark() ? "#ffffff" : "#1c1f23", escape(format_number(v, 2)));
      }

  out += fmt::format(R"(<g text-anchor="{}">)", slanted ? "end" : "middle");
  for (size_t i = 0; i < x_ticks.size(); ++i) {
    const double x = sx.place(x_ticks[i]);
    if (slanted)
      out += fmt::format(R"(<text transform='translate({} {}) rotate(-32)' {}>{}</text>)", px(x + 4), px(f.bottom + 14), kMutedFill,
                         escape(x_labels[i]));
    else
      out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(x), px(f.bottom + 18), kMutedFill, escape(x_labels[i]));
  }
  out += R"(</g><g text-anchor="end">)";
  for (size_t i = 0; i < y_ticks.size(); ++i)
    out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(f.left - 7), px(sy.place(y_ticks[i]) + 4.5), kMutedFill,
                       escape(y_labels[i]));
  out += "</g>";
  out += fmt::format(R"(<text x="{}" y="{}" text-anchor="middle" {}>{}</text>)", px(0.5 * (f.left + f.right)),
                     px(map.height - 11.0), kInkFill, escape(label_text(map.x)));
  out += fmt::format(R"(<text transform='translate({} {}) rotate(-90)' text-anchor="middle" {}>{}</text>)", px(kFont + 1),
                     px(0.5 * (f.top + f.bottom)), kInkFill, escape(label_text(map.y)));

  const double bar_x = f.right + 16.0;
  constexpr int kSlices = 48;
  for (int i = 0; i < kSlices; ++i) {
    const double t = (i + 0.5) / kSlices;
    const double hh = (f.bottom - f.top) / kSlices;
    out += fmt::format(R"(<rect x="{}" y="{}" width="12" height="{}" fill="{}" shape-rendering="crispEdges"/>)", px(bar_x),
                       px(f.bottom - hh * (i + 1)), px(hh + 0.3), colour(range.lo + t * (range.hi - range.lo)).hex());
  }
  const Scale shown{range.lo, range.hi, f.bottom, f.top, false};
  for (size_t i = 0; i < bar_ticks.size(); ++i)
    out += fmt::format(R"(<text x="{}" y="{}" {}>{}</text>)", px(bar_x + 17), px(shown.place(bar_ticks[i]) + 4.5), kMutedFill,
                       escape(bar_labels[i]));
  Axis value{map.value_label, map.value_unit};
  out += fmt::format(R"(<text transform='translate({} {}) rotate(-90)' text-anchor="middle" {}>{}</text>)", px(map.width - 7.0),
                     px(0.5 * (f.top + f.bottom)), kInkFill, escape(label_text(value)));
  return out + "</svg>\n";
}

void write_svg(const Figure& figure, const std::filesystem::path& path) { write_text(svg(figure), path); }
void write_svg(const HeatMap& map, const std::filesystem::path& path) { write_text(svg(map), path); }

}  // namespace terrode::report
