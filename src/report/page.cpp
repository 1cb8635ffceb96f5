#include "report/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "core/problem.h"
#include "core/version.h"
#include "report/assets.h"
#include "report/json_text.h"
#include "report/svg.h"

namespace terrode::report {
namespace {

const char* mood_class(Mood mood) {
  switch (mood) {
    case Mood::good: return "good";
    case Mood::warning: return "warning";
    case Mood::bad: return "bad";
    default: return "neutral";
  }
}

// A sign beside the colour, so that the finding does not hang on hue alone.
std::string mood_sign(Mood mood) {
  const char* path = "M12 8h.01M12 11.5V16";
  const char* word = "Note";
  if (mood == Mood::good) path = "M7.5 12.5l3 3 6-6.5", word = "Good";
  if (mood == Mood::warning) path = "M12 7.5v5.5M12 16.2h.01", word = "Caution";
  if (mood == Mood::bad) path = "M8.5 8.5l7 7M15.5 8.5l-7 7", word = "Problem";
  return fmt::format(R"(<svg viewBox="0 0 24 24" fill="none" stroke="currentColor" stroke-width="2" stroke-linecap="round" stroke-linejoin="round" role="img" aria-label="{}"><circle cx="12" cy="12" r="10"/><path d="{}"/></svg>)",
                     word, path);
}

std::string json(const std::string& text) { return json_text(text); }

// Ten digits carry every measurement and keep long recordings small.
std::string json(double v) { return std::isfinite(v) ? fmt::format("{:.10g}", v) : "null"; }

std::string json(const std::vector<double>& values) {
  std::string out = "[";
  for (size_t i = 0; i < values.size(); ++i) (out += i ? "," : "") += json(values[i]);
  return out + "]";
}

std::string json(const Axis& axis) {
  std::string out = "{\"label\":" + json(axis.label) + ",\"unit\":" + json(axis.unit);
  if (axis.log) out += ",\"log\":true";
  if (std::isfinite(axis.min)) out += ",\"min\":" + json(axis.min);
  if (std::isfinite(axis.max)) out += ",\"max\":" + json(axis.max);
  return out + "}";
}

std::string json(const Figure& figure) {
  static const char* draws[] = {"line", "points", "line_and_points", "steps", "band"};
  std::string out = "{\"title\":" + json(figure.title) + ",\"x\":" + json(figure.x) + ",\"y\":" + json(figure.y) +
                    fmt::format(",\"height\":{}", figure.height) + ",\"series\":[";
  int next = 0;
  for (size_t i = 0; i < figure.series.size(); ++i) {
    const Series& s = figure.series[i];
    const int colour = s.colour == kNextColour ? next++ : s.colour;
    out += (i ? ",{\"name\":" : "{\"name\":") + json(s.name) + ",\"draw\":\"" + draws[static_cast<int>(s.draw)] + "\"" +
           fmt::format(",\"colour\":{}", colour == kInk ? -1 : colour) + (s.dashed ? ",\"dashed\":true" : "") +
           ",\"x\":" + json(s.x);
    if (!s.y.empty()) out += ",\"y\":" + json(s.y);
    if (!s.low.empty()) out += ",\"low\":" + json(s.low) + ",\"high\":" + json(s.high);
    out += "}";
  }
  out += "],\"annotations\":[";
  for (size_t i = 0; i < figure.annotations.size(); ++i) {
    const Annotation& a = figure.annotations[i];
    out += (i ? ",{\"x\":" : "{\"x\":") + json(a.x) + ",\"y\":" + json(a.y) + ",\"text\":" + json(a.text) + "}";
  }
  return out + "]}";
}

std::string json(const HeatMap& map) {
  const auto names = [](const std::vector<std::string>& words, const std::vector<double>& numbers) {
    if (words.empty()) return json(numbers);
    std::string out = "[";
    for (size_t i = 0; i < words.size(); ++i) (out += i ? "," : "") += json(words[i]);
    return out + "]";
  };
  return "{\"title\":" + json(map.title) + ",\"x\":" + json(map.x) + ",\"y\":" + json(map.y) +
         ",\"value\":" + json(Axis{map.value_label, map.value_unit}) + ",\"columns\":" + names(map.x_names, map.x_values) +
         ",\"rows\":" + names(map.y_names, map.y_values) + (map.y_names.empty() ? ",\"bottom_up\":true" : "") +
         ",\"values\":" + json(map.values) + "}";
}

std::string figure_block(size_t index, const std::string& title, const std::string& caption, const std::string& drawing,
                         bool zoom) {
  std::string out = fmt::format(R"(<figure class="card" data-figure="{}"><header><h3>{}</h3>)", index, escape(title));
  out += R"(<div class="buttons"><button class="small svg" type="button" title="Save the drawing">SVG</button><button class="small csv" type="button" title="Save the data">CSV</button></div></header>)";
  out += "<div class=\"static\">" + drawing + "</div>";
  if (zoom) out += "<div class=\"live\"></div>";
  if (!caption.empty()) out += "<figcaption>" + escape(caption) + "</figcaption>";
  return out + "</figure>\n";
}

bool is_text_column(const Table& table, size_t column) {
  bool text = false;
  for (const auto& row : table.rows) {
    if (column >= row.size()) continue;
    if (std::holds_alternative<double>(row[column]) || std::holds_alternative<PlusMinus>(row[column])) return false;
    text = text || std::holds_alternative<std::string>(row[column]);
  }
  return text;
}

std::string plus_minus(const PlusMinus& v, int digits) {
  if (!std::isfinite(v.value) || !(v.error > 0.0) || !std::isfinite(v.error)) return format_number(v.value, digits);
  constexpr int kErrorDigits = 2;
  const int places = kErrorDigits - 1 - static_cast<int>(std::floor(std::log10(v.error)));
  if (places < 0 || places > 6) return format_number(v.value, digits) + " ± " + format_number(v.error, kErrorDigits);
  return fmt::format("{}{:.{}f} ± {:.{}f}", v.value < 0.0 ? "−" : "", std::abs(v.value), places, v.error, places);
}

std::string table_block(const Table& table) {
  Problems problems;
  for (size_t r = 0; r < table.rows.size(); ++r)
    if (table.rows[r].size() > table.columns.size())
      problems.push_back({{}, 0, 0, fmt::format("table \"{}\", row {}", table.caption, r + 1),
                          fmt::format("has {} cells", table.rows[r].size()), fmt::format("at most {}", table.columns.size())});
  throw_if_any(problems);
  std::string out = "<figure class=\"card\"><div class=\"scroll\" tabindex=\"0\"><table";
  constexpr size_t kDense = 8;
  out += table.columns.size() > kDense ? " class=\"dense\"><thead>" : "><thead>";
  std::vector<bool> text(table.columns.size());
  const auto group_ends = [&](size_t c) {
    return c + 1 < table.columns.size() && table.columns[c + 1].group != table.columns[c].group;
  };
  if (std::any_of(table.columns.begin(), table.columns.end(), [](const Column& c) { return !c.group.empty(); })) {
    out += "<tr class=\"groups\">";
    for (size_t c = 0, end; c < table.columns.size(); c = end) {
      for (end = c + 1; end < table.columns.size() && table.columns[end].group == table.columns[c].group;) ++end;
      out += fmt::format("<th colspan=\"{}\"{}>{}</th>", end - c, end < table.columns.size() ? " class=\"gap\"" : "",
                         escape(table.columns[c].group));
    }
    out += "</tr>";
  }
  out += "<tr>";
  for (size_t c = 0; c < table.columns.size(); ++c) {
    text[c] = is_text_column(table, c);
    out += fmt::format("<th scope=\"col\" class=\"{}{}\">", text[c] ? "text" : "", group_ends(c) ? " gap" : "");
    out += escape(table.columns[c].header);
    if (!table.columns[c].unit.empty()) out += "<span class=\"unit\">" + escape(table.columns[c].unit) + "</span>";
    out += "</th>";
  }
  out += "</tr></thead><tbody>\n";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (size_t c = 0; c < table.columns.size(); ++c) {
      std::string cell;
      if (c < row.size()) {
        if (const auto* v = std::get_if<double>(&row[c])) cell = format_number(*v, table.columns[c].digits);
        if (const auto* v = std::get_if<PlusMinus>(&row[c])) cell = plus_minus(*v, table.columns[c].digits);
        if (const auto* s = std::get_if<std::string>(&row[c])) cell = *s;
      }
      const bool is_long = cell.size() > 40;
      out += fmt::format("<td class=\"{}{}{}\">", text[c] ? "text" : "", is_long ? " long" : "", group_ends(c) ? " gap" : "");
      out += escape(cell) + "</td>";
    }
    out += "</tr>\n";
  }
  out += "</tbody></table></div>";
  if (!table.caption.empty()) out += "<figcaption>" + escape(table.caption) + "</figcaption>";
  return out + "</figure>\n";
}

}  // namespace

bool interactive_figures() { return !assets::uplot_js().empty(); }

Page::Page(std::string title) : title_(std::move(title)) {}

Page& Page::subtitle(std::string text) { return subtitle_ = std::move(text), *this; }
Page& Page::command(std::string line) { return command_ = std::move(line), *this; }
Page& Page::verdict(Mood mood, std::string sentence) {
  mood_ = mood;
  verdict_ = std::move(sentence);
  return *this;
}
Page& Page::facts(std::vector<std::pair<std::string, std::string>> label_and_value) {
  facts_ = std::move(label_and_value);
  return *this;
}
Page& Page::section(std::string heading) { return blocks_.emplace_back(Heading{std::move(heading)}), *this; }
Page& Page::text(std::string paragraph) { return blocks_.emplace_back(Text{std::move(paragraph)}), *this; }
Page& Page::list(std::vector<std::string> items) { return blocks_.emplace_back(List{std::move(items)}), *this; }
Page& Page::callout(Mood mood, std::string heading, std::string paragraph) {
  return blocks_.emplace_back(Callout{mood, std::move(heading), std::move(paragraph)}), *this;
}
Page& Page::table(Table t) { return blocks_.emplace_back(std::move(t)), *this; }
Page& Page::figure(Figure f) { return figures({std::move(f)}); }
Page& Page::figures(std::vector<Figure> side_by_side) {
  return blocks_.emplace_back(Figures{std::move(side_by_side)}), *this;
}
Page& Page::heat_map(HeatMap map) { return blocks_.emplace_back(std::move(map)), *this; }
Page& Page::listing(std::string heading, std::string listed, bool folded) {
  return blocks_.emplace_back(Listing{std::move(heading), std::move(listed), folded}), *this;
}
Page& Page::download(std::string file_name, std::string content) {
  return blocks_.emplace_back(Download{std::move(file_name), std::move(content)}), *this;
}

std::string Page::html() const {
  std::string body, figures_json, downloads_json;
  size_t figure_count = 0, download_count = 0;
  bool any_live = false;
  const auto add_json = [](std::string& list, const std::string& item) { list += (list.empty() ? "" : ",") + item; };

  for (const Block& block : blocks_) {
    if (const auto* heading = std::get_if<Heading>(&block)) {
      body += "<h2>" + escape(heading->text) + "</h2>\n";
    } else if (const auto* paragraph = std::get_if<Text>(&block)) {
      body += "<p>" + escape(paragraph->text) + "</p>\n";
    } else if (const auto* bullets = std::get_if<List>(&block)) {
      body += "<ul>";
      for (const auto& item : bullets->items) body += "<li>" + escape(item) + "</li>";
      body += "</ul>\n";
    } else if (const auto* callout = std::get_if<Callout>(&block)) {
      body += fmt::format("<div class=\"callout {}\">{}<div><h3>{}</h3><p>{}</p></div></div>\n", mood_class(callout->mood),
                          mood_sign(callout->mood), escape(callout->heading), escape(callout->text));
    } else if (const auto* table = std::get_if<Table>(&block)) {
      body += table_block(*table);
    } else if (const auto* group = std::get_if<Figures>(&block)) {
      const bool pair = group->figures.size() > 1;
      if (pair) body += "<div class=\"pair\">\n";
      for (const Figure& figure : group->figures) {
        Figure drawn = figure;
        if (pair) drawn.width = std::min(drawn.width, 520), drawn.height = std::min(drawn.height, 360);
        const bool zoom = interactive_figures();
        any_live = any_live || zoom;
        body += figure_block(figure_count, drawn.title, drawn.caption,
                             svg(drawn, {.standalone = false, .id = fmt::format("f{}", figure_count)}), zoom);
        add_json(figures_json, json(drawn));
        ++figure_count;
      }
      if (pair) body += "</div>\n";
    } else if (const auto* map = std::get_if<HeatMap>(&block)) {
      body += figure_block(figure_count, map->title, map->caption,
                           svg(*map, {.standalone = false, .id = fmt::format("f{}", figure_count)}), false);
      add_json(figures_json, json(*map));
      ++figure_count;
    } else if (const auto* listing = std::get_if<Listing>(&block)) {
      if (listing->folded)
        body += "<details class=\"card\"><summary>" + escape(listing->heading) + "</summary><pre>" + escape(listing->text) +
                "</pre></details>\n";
      else
        body += "<div class=\"card listing\"><h3>" + escape(listing->heading) + "</h3><pre>" + escape(listing->text) + "</pre></div>\n";
    } else if (const auto* download = std::get_if<Download>(&block)) {
      body += fmt::format("<button class=\"download\" type=\"button\" data-download=\"{0}\" data-index=\"{1}\">Save {0}</button>\n",
                          escape(download->file_name), download_count++);
      add_json(downloads_json, json(download->content));
    }
  }

  std::string out = "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  out += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  out += "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
         "script-src 'unsafe-inline'; img-src data: blob:\">\n";
  out += fmt::format("<meta name=\"generator\" content=\"terrode {}\">\n", escape(version()));
  out += "<title>" + escape(title_) + "</title>\n<style>\n";
  if (any_live) out += assets::uplot_css();
  out += assets::page_css();
  out += "</style>\n</head>\n<body>\n<main>\n<div class=\"top\"><div><h1>" + escape(title_) + "</h1>";
  if (!subtitle_.empty()) out += "<p class=\"subtitle\">" + escape(subtitle_) + "</p>";
  out += R"(</div><button class="theme" type="button" title="Light or dark" aria-label="Light or dark"><svg viewBox="0 0 24 24" fill="none" stroke="currentColor" stroke-width="2"><circle cx="12" cy="12" r="9"/><path d="M12 3a9 9 0 0 1 0 18z" fill="currentColor"/></svg></button></div>)";
  out += "\n";
  if (!verdict_.empty())
    out += fmt::format("<div class=\"verdict {}\" id=\"verdict\">{}<p>{}</p></div>\n", mood_class(mood_), mood_sign(mood_),
                       escape(verdict_));
  if (!facts_.empty()) {
    out += "<dl class=\"facts\">";
    for (const auto& [label, value] : facts_) out += "<div><dt>" + escape(label) + "</dt><dd>" + escape(value) + "</dd></div>";
    out += "</dl>\n";
  }
  if (!command_.empty())
    out += fmt::format("<div class=\"command\"><code>{0}</code><button class=\"small\" type=\"button\" data-copy=\"{0}\">Copy</button></div>\n",
                       escape(command_));
  out += body;
  out += fmt::format("<footer>Written by terrode {} ({}).", escape(version()), escape(commit()));
  if (any_live) out += " Drag over a curve to zoom, double-click to see all of it, click a name to hide it. Curves by uPlot (MIT licence).";
  out += "</footer>\n</main>\n";
  out += "<script type=\"application/json\" id=\"data\">{\"figures\":[" + figures_json + "],\"downloads\":[" + downloads_json + "]}</script>\n";
  if (any_live) {
    out += "<script>";
    out += assets::uplot_js();
    out += "</script>\n";
  }
  out += "<script>\n";
  out += assets::page_js();
  return out + "</script>\n</body>\n</html>\n";
}

void Page::write_html(const std::filesystem::path& path) const {
  const std::string text = html();
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw RunError("cannot write " + path.string());
}

}  // namespace terrode::report
