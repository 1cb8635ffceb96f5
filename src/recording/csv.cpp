#include "recording/csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <set>

#include "core/system_error.h"
#include "recording/gap.h"

namespace terrode::recording {
namespace {

constexpr std::size_t kBadCellsKept = 5;
constexpr std::size_t kRowProblemsKept = 10;
constexpr std::size_t kRowProblemsRead = 10'000;  // each may be filled up with thousands of gaps
constexpr std::size_t kTextTableBytes = std::size_t{16} << 20;

bool blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trim(std::string_view s) {
  while (!s.empty() && blank(s.front())) s.remove_prefix(1);
  while (!s.empty() && blank(s.back())) s.remove_suffix(1);
  return s;
}

bool same_word(std::string_view a, std::string_view lower) {
  return a.size() == lower.size() && std::equal(a.begin(), a.end(), lower.begin(), [](char x, char y) {
           return (x >= 'A' && x <= 'Z' ? static_cast<char>(x - 'A' + 'a') : x) == y;
         });
}

bool means_missing(std::string_view cell) {
  return cell.empty() || same_word(cell, "nan") || same_word(cell, "na") || same_word(cell, "n/a") ||
         same_word(cell, "null");
}

// Splits one line into cells; quotes protect separators, brackets of a header do too.
struct Splitter {
  char separator;
  bool header = false;

  // Calls cell(text, position) for each; returns false on a quote that never ends.
  template <typename Cell>
  bool split(std::string_view line, Cell&& cell) const {
    std::size_t at = 0;
    for (;;) {
      if (separator == ' ') {
        while (at < line.size() && blank(line[at])) ++at;
        if (at >= line.size()) return true;
      }
      const std::size_t begin = at;
      bool quoted = false;
      int depth = 0;
      while (at < line.size()) {
        const char c = line[at];
        if (c == '"') quoted = !quoted;
        if (header && c == '[') ++depth;
        if (header && c == ']') --depth;
        if (!quoted && depth <= 0 && (c == separator || (separator == ' ' && c == '\t'))) break;
        ++at;
      }
      if (quoted) return false;
      std::size_t from = begin;
      while (from < at && line[from] == ' ') ++from;
      cell(trim(line.substr(begin, at - begin)), from);
      if (at >= line.size()) return true;
      ++at;
    }
  }
};

std::string unquote(std::string_view cell) {
  if (cell.size() < 2 || cell.front() != '"' || cell.back() != '"') return std::string(cell);
  std::string out;
  for (std::size_t i = 1; i + 1 < cell.size(); ++i) {
    if (cell[i] == '"' && cell[i + 1] == '"' && i + 2 < cell.size()) ++i;
    out.push_back(cell[i]);
  }
  return std::string(trim(out));
}

char find_separator(std::string_view line) {
  bool quoted = false;
  int depth = 0;
  bool semicolon = false, comma = false;
  for (const char c : line) {
    if (c == '"') quoted = !quoted;
    if (c == '[') ++depth;
    if (c == ']') --depth;
    if (quoted || depth > 0) continue;
    if (c == '\t') return '\t';
    semicolon = semicolon || c == ';';
    comma = comma || c == ',';
  }
  return semicolon ? ';' : ',';
}

// Walks over lines and counts them.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {}
  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    const char* end = static_cast<const char*>(std::memchr(rest_.data(), '\n', rest_.size()));
    const std::size_t n = end ? static_cast<std::size_t>(end - rest_.data()) : rest_.size();
    line = rest_.substr(0, n);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    rest_.remove_prefix(end ? n + 1 : n);
    ++number_;
    return true;
  }
  int number() const { return number_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

[[noreturn]] void refuse(const std::string& file, int line, const std::string& message, const std::string& expected = {}) {
  throw InputError(Problem{file, line, 0, {}, message, expected});
}

void refuse_binary(std::string_view text, const std::string& file) {
  const std::string_view head = text.substr(0, 4096);
  if (head.starts_with("\xff\xfe") || head.starts_with("\xfe\xff"))
    refuse(file, 1, "is UTF-16 text", "UTF-8 or ASCII (save it as UTF-8)");
  if (head.find('\0') != std::string_view::npos) refuse(file, 1, "is a binary file", "a text table");
}

bool skipped(std::string_view line, const CsvFormat& format) {
  const std::string_view t = trim(line);
  return t.empty() || (format.comment != '\0' && t.front() == format.comment);
}

// Reads the lines before the data and makes the columns. Returns false when the file has no line that counts.
bool begin_table(Lines& lines, std::string_view text, const CsvFormat& format, const std::string& file, char& separator,
                 int& header_line, std::vector<CsvColumn>& columns, Problems& problems) {
  std::string_view line;
  for (std::size_t i = 0; i < format.skip_rows; ++i)
    if (!lines.next(line)) refuse(file, lines.number(), fmt::format("has fewer than the {} lines to skip", format.skip_rows));
  const Lines before = lines;
  (void)text;
  do {
    if (!lines.next(line)) return false;
  } while (skipped(line, format));
  separator = format.separator != '\0' ? format.separator : find_separator(line);
  const Splitter splitter{separator, format.header};
  const bool ended = splitter.split(line, [&](std::string_view cell, std::size_t at) {
    if (columns.size() == format.max_columns)
      refuse(file, lines.number(), fmt::format("has more than {} columns", format.max_columns), "fewer");
    CsvColumn c;
    if (format.header) {
      HeaderName name = split_header(unquote(cell));
      c.name = std::move(name.name);
      c.unit = std::move(name.unit);
      c.has_unit = name.has_unit;
    } else {
      c.name = std::to_string(columns.size() + 1);
    }
    c.header_column = static_cast<int>(at) + 1;
    columns.push_back(std::move(c));
  });
  if (!ended) refuse(file, lines.number(), "has a quote that does not end");
  if (!format.header) {
    lines = before;
    return true;
  }
  header_line = lines.number();
  // A separator at the end of every line is common; a last column without name that stays empty is dropped later.
  std::set<std::string> seen;
  std::size_t numbers = 0;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const CsvColumn& c = columns[i];
    double ignored = 0.0;
    const auto [end, error] = std::from_chars(c.name.data(), c.name.data() + c.name.size(), ignored);
    if (error == std::errc{} && end == c.name.data() + c.name.size()) ++numbers;
    if (c.name.empty() && i + 1 < columns.size())
      problems.push_back({file, header_line, c.header_column, {}, fmt::format("column {} has no name", i + 1), {}});
    if (!c.name.empty() && !seen.insert(c.name).second)
      problems.push_back({file, header_line, c.header_column, c.name, "names two columns", "each name once"});
  }
  if (numbers == columns.size())
    problems.push_back({file, header_line, 0, {}, "the first line holds numbers, not names",
                        "a header such as 'time [s],drawbar_pull [N]', or a format that says there is none"});
  return true;
}

void cell_count_problem(Problems& problems, std::size_t& count, const std::string& file, int line, std::size_t cells,
                        std::size_t columns) {
  if (++count > kRowProblemsRead)
    refuse(file, line, fmt::format("is one of more than {} rows with too few or too many cells", kRowProblemsRead));
  if (count <= kRowProblemsKept)
    problems.push_back({file, line, 0, {}, fmt::format("has {} cells", cells), fmt::format("{} as in the header", columns)});
}

}  // namespace

HeaderName split_header(std::string_view cell) {
  HeaderName out;
  cell = trim(cell);
  const std::size_t open = cell.rfind('[');
  if (open != std::string_view::npos && cell.back() == ']') {
    out.unit = std::string(trim(cell.substr(open + 1, cell.size() - open - 2)));
    out.has_unit = true;
    cell = trim(cell.substr(0, open));
  }
  out.name = std::string(cell);
  return out;
}

const CsvColumn* CsvTable::find(std::string_view name) const {
  for (const CsvColumn& c : columns)
    if (c.name == name) return &c;
  return nullptr;
}

Problems CsvTable::cell_problems(const CsvColumn& column) const {
  Problems out;
  for (const BadCell& b : column.bad) {
    std::string expected = "a number, or an empty cell where it is missing";
    if (b.text.find(',') != std::string::npos) expected += " (a decimal comma has to be declared)";
    out.push_back({file, b.line, b.column, column.name, fmt::format("is '{}'", b.text), expected});
  }
  if (column.bad_count > column.bad.size())
    out.push_back({file, 0, 0, column.name, fmt::format("has {} more cells that are not numbers", column.bad_count - column.bad.size()), {}});
  return out;
}

std::string read_file_bytes(const std::string& path, std::size_t max_bytes) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) refuse(path, 0, "no such file");
  if (std::filesystem::is_directory(status)) refuse(path, 0, "is a folder", "a file");
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (!file) refuse(path, 0, std::string("cannot be read: ") + system_error_text(errno));
  std::string bytes;
  const auto size = std::filesystem::file_size(path, error);
  if (!error) {
    if (size > max_bytes) {
      std::fclose(file);
      refuse(path, 0, fmt::format("has {} bytes", size), fmt::format("at most {}", max_bytes));
    }
    bytes.reserve(static_cast<std::size_t>(size) + 1);
  }
  char block[1 << 16];
  std::size_t n = 0;
  while ((n = std::fread(block, 1, sizeof block, file)) > 0) {
    bytes.append(block, n);
    if (bytes.size() > max_bytes) break;
  }
  const bool failed = std::ferror(file) != 0;
  std::fclose(file);
  if (failed) refuse(path, 0, "cannot be read to its end");
  if (bytes.size() > max_bytes) refuse(path, 0, "is too long", fmt::format("at most {} bytes", max_bytes));
  return bytes;
}

CsvTable parse_csv(std::string_view text, const std::string& file, const CsvFormat& format) {
  refuse_binary(text, file);
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  CsvTable table;
  table.file = file;
  Lines lines(text);
  if (!begin_table(lines, text, format, file, table.separator, table.header_line, table.columns, table.problems))
    refuse(file, 0, "is empty", "a header and at least one row");
  std::vector<CsvColumn>& columns = table.columns;
  const bool open_end = format.header && columns.size() > 1 && columns.back().name.empty();
  if (open_end) columns.pop_back();
  const std::size_t width = columns.size();

  // Rows are about as long as the first one: reserving by that avoids most reallocation.
  const std::size_t guess = text.size() / std::max<std::size_t>(8 * width, 8) + 16;
  for (CsvColumn& c : columns) c.values.reserve(guess);
  table.lines.reserve(guess);

  const Splitter splitter{table.separator};
  std::size_t row_problems = 0;
  std::string scratch;
  std::string_view line;
  while (lines.next(line)) {
    if (skipped(line, format)) continue;
    if (table.lines.size() >= format.max_rows)
      refuse(file, lines.number(), "has more rows than are read", fmt::format("at most {}", format.max_rows));
    std::size_t k = 0;
    const bool ended = splitter.split(line, [&](std::string_view cell, std::size_t at) {
      if (k >= width) {
        if (!(open_end && k == width && cell.empty())) k = std::max(k, width) + 1;
        return;
      }
      CsvColumn& column = columns[k++];
      if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') cell = trim(cell.substr(1, cell.size() - 2));
      std::string_view digits = cell;
      bool usable = true;
      if (format.decimal_comma && cell.find(',') != std::string_view::npos) {
        usable = cell.find('.') == std::string_view::npos;  // "1.234,5" is not read as anything
        scratch.assign(cell);
        std::replace(scratch.begin(), scratch.end(), ',', '.');
        digits = scratch;
      }
      if (digits.size() > 1 && digits.front() == '+' && digits[1] != '-') digits.remove_prefix(1);
      double value = 0.0;
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
      if (usable && error == std::errc{} && end == digits.data() + digits.size() && std::isfinite(value)) {
        column.values.push_back(value);
        return;
      }
      column.values.push_back(kGap);
      if (means_missing(cell)) {
        ++column.missing;
        return;
      }
      if (++column.bad_count <= kBadCellsKept)
        column.bad.push_back({lines.number(), static_cast<int>(at) + 1, std::string(cell.substr(0, 40))});
    });
    table.lines.push_back(lines.number());
    if (ended && k == width) continue;
    if (!ended) {
      if (++row_problems <= kRowProblemsKept)
        table.problems.push_back({file, lines.number(), 0, {}, "has a quote that does not end", {}});
      if (row_problems > kRowProblemsRead)
        refuse(file, lines.number(), fmt::format("is one of more than {} rows that are not whole", kRowProblemsRead));
    } else {
      std::size_t cells = 0;
      splitter.split(line, [&](std::string_view, std::size_t) { ++cells; });
      cell_count_problem(table.problems, row_problems, file, lines.number(), cells, width);
    }
    for (; k < width; ++k) {
      columns[k].values.push_back(kGap);
      ++columns[k].missing;
    }
  }
  if (row_problems > kRowProblemsKept)
    table.problems.push_back({file, 0, 0, {}, fmt::format("{} more rows are not whole", row_problems - kRowProblemsKept), {}});
  if (table.lines.empty()) table.problems.push_back({file, table.header_line, 0, {}, "has no rows", "at least one"});
  return table;
}

CsvTable read_csv(const std::string& path, const CsvFormat& format) {
  return parse_csv(read_file_bytes(path, format.max_bytes), path, format);
}

TextTable read_text_table(const std::string& path, const CsvFormat& format) {
  const std::string bytes = read_file_bytes(path, std::min(format.max_bytes, kTextTableBytes));
  std::string_view text = bytes;
  refuse_binary(text, path);
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  TextTable table;
  table.file = path;
  Lines lines(text);
  char separator = ',';
  int header_line = 0;
  if (!begin_table(lines, text, format, path, separator, header_line, table.columns, table.problems))
    refuse(path, 0, "is empty", "a header and at least one row");
  const bool open_end = format.header && table.columns.size() > 1 && table.columns.back().name.empty();
  if (open_end) table.columns.pop_back();
  const Splitter splitter{separator};
  std::string_view line;
  std::size_t row_problems = 0;
  while (lines.next(line)) {
    if (skipped(line, format)) continue;
    std::vector<TextTable::Cell> row;
    std::size_t cells = 0;
    const bool ended = splitter.split(line, [&](std::string_view cell, std::size_t at) {
      if (++cells <= table.columns.size() + 1) row.push_back({unquote(cell), lines.number(), static_cast<int>(at) + 1});
    });
    if (open_end && row.size() == table.columns.size() + 1 && row.back().text.empty()) row.pop_back();
    if (!ended) {
      refuse(path, lines.number(), "has a quote that does not end");
    } else if (row.size() != table.columns.size()) {
      cell_count_problem(table.problems, row_problems, path, lines.number(), cells, table.columns.size());
    }
    row.resize(table.columns.size(), {{}, lines.number(), 0});
    table.rows.push_back(std::move(row));
  }
  if (row_problems > kRowProblemsKept)
    table.problems.push_back({path, 0, 0, {}, fmt::format("{} more rows are not whole", row_problems - kRowProblemsKept), {}});
  if (table.rows.empty()) table.problems.push_back({path, header_line, 0, {}, "has no rows", "at least one"});
  return table;
}

}  // namespace terrode::recording
