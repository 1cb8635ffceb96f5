// One look for every report: a page is filled from top to bottom and written as a single HTML file that needs no network.
//
//   Page page("Slip sweep of the smooth wheel");
//   page.subtitle("Ding et al. 2011, 80 N").command("terrode sweep scenarios/ding2011.yaml --report sweep.html");
//   page.verdict(Mood::good, "Drawbar pull agrees with the measurement within 8 %.");
//   page.section("Curves").figure(drawbar).figures({torque, sinkage});
//   page.section("Numbers").table(numbers);
//   page.write_html("sweep.html");
//
// Figures are drawn twice: as SVG by svg.h (print, no scripts, download) and, where the plotting library was there when
// the program was built, as curves to zoom and hover. All text is escaped; the same page gives the same bytes.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "report/figure.h"

namespace terrode::report {

enum class Mood { good, neutral, warning, bad };

// A number with its standard error, shown as "12.34 ± 0.05": the error with two digits, the value down to the same place.
struct PlusMinus {
  double value, error;
};

// A cell: empty, a number (formatted by its column), a number with its error, or text.
using Cell = std::variant<std::monostate, double, PlusMinus, std::string>;

struct Column {
  std::string header;
  std::string unit = {};        // shown in the header; empty: none
  int digits = 4;          // significant digits
  std::string group = {};  // neighbours of one group get a common head above theirs
};

struct Table {
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows = {};   // a short row is filled up with empty cells; a long one is an InputError
  std::string caption = {};
};

class Page {
 public:
  explicit Page(std::string title);

  // Head of the page.
  Page& subtitle(std::string text);                   // one line under the title
  Page& command(std::string line);                    // the command that made the page, shown with a copy button
  Page& verdict(Mood mood, std::string sentence);     // the finding in one or two sentences, first thing to be read
  Page& facts(std::vector<std::pair<std::string, std::string>> label_and_value);  // up to six headline numbers

  // Body, in order.
  Page& section(std::string heading);
  Page& text(std::string paragraph);
  Page& list(std::vector<std::string> items);
  Page& callout(Mood mood, std::string heading, std::string paragraph);
  Page& table(Table table);
  Page& figure(Figure figure);                        // full width
  Page& figures(std::vector<Figure> side_by_side);    // two a row on a wide screen
  Page& heat_map(HeatMap map);
  Page& listing(std::string heading, std::string text, bool folded = true);  // scenario text, log
  Page& download(std::string file_name, std::string content);  // a button that saves `content` (JSON, YAML, CSV)

  // The whole page. Throws InputError like svg() and for a table with rows longer than its head.
  std::string html() const;

  // Writes html() to a file. Throws RunError when that fails.
  void write_html(const std::filesystem::path& path) const;

 private:
  struct Text { std::string text; };
  struct Heading { std::string text; };
  struct List { std::vector<std::string> items; };
  struct Callout { Mood mood; std::string heading, text; };
  struct Figures { std::vector<Figure> figures; };
  struct Listing { std::string heading, text; bool folded; };
  struct Download { std::string file_name, content; };
  using Block = std::variant<Text, Heading, List, Callout, Table, Figures, HeatMap, Listing, Download>;

  std::string title_, subtitle_, command_, verdict_;
  Mood mood_ = Mood::neutral;
  std::vector<std::pair<std::string, std::string>> facts_;
  std::vector<Block> blocks_;
};

// True when the plotting library was there at build time, so that pages have curves to zoom and hover.
bool interactive_figures();

}  // namespace terrode::report
