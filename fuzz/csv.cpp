// Tables as text. The first byte picks how they are written.
#include "harness.h"
#include "recording/columns.h"
#include "recording/csv.h"

FUZZ(csv) {
  using namespace terrode;
  if (size == 0) return;
  recording::CsvFormat format;
  const char separators[] = {'\0', ',', ';', ' '};
  format.separator = separators[data[0] & 3];
  format.decimal_comma = (data[0] & 4) != 0;
  format.header = (data[0] & 8) == 0;
  format.skip_rows = (data[0] >> 4) & 3;
  format.comment = (data[0] & 64) ? '#' : '\0';
  try {
    const std::string_view text(reinterpret_cast<const char*>(data + 1), size - 1);
    const recording::CsvTable table = recording::parse_csv(text, "fuzz.csv", format);
    recording::ReadingRule rule;
    rule.csv = format;
    recording::Run run;
    Problems problems;
    std::vector<recording::Remark> remarks;
    recording::fill_run(table, rule, run, problems, remarks);
  } catch (const InputError&) {
  }
  (void)recording::read_text_table(fuzz::as_file("fuzz.csv", data + 1, size - 1), format);
}
