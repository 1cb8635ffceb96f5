// Tables of numbers as text, read strictly and fast: every cell that is not a number is found with its line and column.
//
// A header line names each column with its unit in brackets, "drawbar_pull [N]". Files without one, with other
// separators, with a decimal comma or with lines before the header are read when CsvFormat says so; nothing of that is
// guessed but the separator (tab, semicolon or comma, whichever the first line holds, in this order).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "core/problem.h"

namespace terrode::recording {

struct CsvFormat {
  char separator = '\0';         // 0: found from the first line; ' ' takes any run of blanks as one
  bool decimal_comma = false;    // "1,5" is one and a half
  bool header = true;            // the first line names the columns; else they are "1", "2", ...
  std::size_t skip_rows = 0;     // lines before the header (or the first row)
  char comment = '\0';           // lines that begin with it are skipped; 0: none
  std::size_t max_bytes = std::size_t{1} << 30;  // numbers take up to eight times as much in memory
  std::size_t max_rows = 200'000'000;
  std::size_t max_columns = 4096;
};

// A cell that is neither a number nor empty.
struct BadCell {
  int line = 0;
  int column = 0;  // character position in the line, from 1
  std::string text;
};

struct CsvColumn {
  std::string name;               // header text before the bracket
  std::string unit;               // text in the bracket, as written
  bool has_unit = false;          // there was a bracket
  int header_column = 0;          // character position of its header, from 1
  std::vector<double> values;     // as written, no conversion; NaN where the cell is empty or bad
  std::size_t missing = 0;        // empty cells and "nan", "na", "n/a", "null" in any case
  std::size_t bad_count = 0;
  std::vector<BadCell> bad;       // the first few of them
};

struct CsvTable {
  std::string file;
  int header_line = 0;             // 0 without header
  char separator = ',';            // the one that was used
  std::vector<CsvColumn> columns;
  std::vector<int> lines;          // line of each row, from 1
  Problems problems;               // rows with too few or too many cells, columns named twice, ...: all that were found

  std::size_t rows() const { return lines.size(); }
  const CsvColumn* find(std::string_view name) const;
  // One problem for each bad cell kept, and one that counts the rest.
  Problems cell_problems(const CsvColumn& column) const;
};

// Reads a file. Throws InputError where it cannot be read, is binary, is empty or goes over a limit; whatever is wrong
// with single rows and cells is in the table, for the caller to judge.
CsvTable read_csv(const std::string& path, const CsvFormat& format = {});

// The same from text; `file` is the name that problems give.
CsvTable parse_csv(std::string_view text, const std::string& file, const CsvFormat& format = {});

// A table whose cells are kept as text (a runs table: a few rows, some columns of words).
struct TextTable {
  struct Cell {
    std::string text;  // trimmed, quotes removed
    int line = 0;
    int column = 0;
  };
  std::string file;
  std::vector<CsvColumn> columns;         // names and units; no values
  std::vector<std::vector<Cell>> rows;    // as many cells as columns
  Problems problems;
};
TextTable read_text_table(const std::string& path, const CsvFormat& format = {});

// Splits "drawbar_pull [N]" into name and unit.
struct HeaderName {
  std::string name, unit;
  bool has_unit = false;
};
HeaderName split_header(std::string_view cell);

// A file's bytes. Throws InputError where it is missing, a folder, unreadable or longer than `max_bytes`.
std::string read_file_bytes(const std::string& path, std::size_t max_bytes);

}  // namespace terrode::recording
