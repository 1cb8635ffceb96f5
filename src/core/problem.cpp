#include "core/problem.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace terrode {

std::string Problem::text() const {
  std::string out;
  if (!file.empty()) {
    out += file;
    if (line > 0) out += fmt::format(":{}", line);
    if (line > 0 && column > 0) out += fmt::format(":{}", column);
    out += ": ";
  }
  if (!key.empty()) out += key + ": ";
  out += message;
  if (!expected.empty()) out += ", expected " + expected;
  return out;
}

static std::string join(const Problems& problems) {
  std::string out;
  for (const Problem& p : problems) out += (out.empty() ? "" : "\n") + p.text();
  return out.empty() ? "unspecified input problem" : out;
}

InputError::InputError(Problems problems) : std::runtime_error(join(problems)), problems_(std::move(problems)) {}

void throw_if_any(const Problems& problems) {
  if (!problems.empty()) throw InputError(problems);
}

void require(Problems& problems, const std::string& key, double value, const char* unit, bool ok,
             const std::string& expected) {
  if (std::isfinite(value) && ok) return;
  const std::string spaced = *unit ? std::string(" ") + unit : "";
  problems.push_back({{}, 0, 0, key, fmt::format("is {}{}", value, spaced), expected});
}

int edit_distance(const std::string& a, const std::string& b) {
  const size_t n = a.size(), m = b.size();
  std::vector<std::vector<int>> d(n + 1, std::vector<int>(m + 1));
  for (size_t i = 0; i <= n; ++i) d[i][0] = static_cast<int>(i);
  for (size_t j = 0; j <= m; ++j) d[0][j] = static_cast<int>(j);
  for (size_t i = 1; i <= n; ++i) {
    for (size_t j = 1; j <= m; ++j) {
      const int change = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[n][m];
}

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  int best_distance = std::max(1, static_cast<int>(word.size()) / 3) + 1;
  for (const std::string& k : known) {
    // The distance is at least the difference in length: a word of a megabyte is near nothing, and not worth a table.
    const std::size_t apart = std::max(word.size(), k.size()) - std::min(word.size(), k.size());
    if (apart >= static_cast<std::size_t>(best_distance)) continue;
    const int d = edit_distance(word, k);
    if (d < best_distance) {
      best_distance = d;
      best = k;
    }
  }
  return best;
}

}  // namespace terrode
