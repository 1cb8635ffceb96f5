#include "recording/checkpoint.h"

#include <fmt/format.h>

namespace terrode::recording {
namespace {

constexpr const char* kGroup = "/checkpoint";

// FNV-1a (Fowler, Noll, Vo 1991): damage must be found, not malice.
class Digest {
 public:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ bytes[i]) * 1099511628211ull;
  }
  std::string text() const { return fmt::format("{:016x}", hash_); }

 private:
  std::uint64_t hash_ = 1469598103934665603ull;
};

std::string digest(const Checkpoint& c) {
  Digest d;
  d.add(c.work.data(), c.work.size());
  for (const auto& [name, values] : c.numbers) {
    d.add(name.data(), name.size());
    d.add(values.data(), values.size() * sizeof(double));
  }
  for (const auto& [name, values] : c.bytes) {
    d.add(name.data(), name.size());
    d.add(values.data(), values.size());
  }
  return d.text();
}

[[noreturn]] void missing(const std::string& name) {
  throw InputError(Problem{{}, 0, 0, "checkpoint", fmt::format("has no part '{}'", name), "the state of this work"});
}

}  // namespace

const std::vector<double>& Checkpoint::number(const std::string& name) const {
  const auto found = numbers.find(name);
  if (found == numbers.end()) missing(name);
  return found->second;
}

const std::vector<std::uint8_t>& Checkpoint::byte(const std::string& name) const {
  const auto found = bytes.find(name);
  if (found == bytes.end()) missing(name);
  return found->second;
}

void Checkpoint::put_samples(const Run& run) {
  std::vector<double>& out = numbers["samples"];
  out = run.time;
  for (const Channel& c : run.channels) out.insert(out.end(), c.values.begin(), c.values.end());
}

void Checkpoint::take_samples(Run& run) const {
  const std::vector<double>& in = number("samples");
  const std::size_t columns = run.channels.size() + 1, rows = in.size() / columns;
  if (rows * columns != in.size())
    throw InputError(Problem{{}, 0, 0, "checkpoint", "has samples of another run", fmt::format("{} columns", columns)});
  const auto column = [&](std::size_t k) { return in.begin() + static_cast<std::ptrdiff_t>(k * rows); };
  run.time.assign(column(0), column(1));
  for (std::size_t k = 1; k < columns; ++k) run.channels[k - 1].values.assign(column(k), column(k + 1));
}

void write_checkpoint(Hdf5File& file, const Checkpoint& c) {
  if (file.exists(kGroup)) file.remove(kGroup);
  file.create_group(kGroup);
  file.write(std::string(kGroup) + "/work", std::vector<std::uint8_t>(c.work.begin(), c.work.end()));
  for (const auto& [name, values] : c.numbers) file.write(fmt::format("{}/numbers/{}", kGroup, name), values);
  for (const auto& [name, values] : c.bytes) file.write(fmt::format("{}/bytes/{}", kGroup, name), values);
  file.set_attribute(kGroup, "digest", digest(c));
}

std::optional<Checkpoint> read_checkpoint(const Hdf5File& file) {
  if (!file.is_group(kGroup)) return std::nullopt;
  Checkpoint c;
  try {
    const auto work = file.read<std::uint8_t>(std::string(kGroup) + "/work").values;
    c.work.assign(work.begin(), work.end());
    for (const char* kind : {"numbers", "bytes"}) {
      const std::string group = fmt::format("{}/{}", kGroup, kind);
      if (!file.is_group(group)) continue;
      for (const std::string& name : file.children(group)) {
        const std::string path = group + "/" + name;
        if (*kind == 'n')
          c.numbers[name] = file.read<double>(path).values;
        else
          c.bytes[name] = file.read<std::uint8_t>(path).values;
      }
    }
  } catch (const RunError& e) {
    throw InputError(Problem{file.path(), 0, 0, kGroup, fmt::format("is damaged: {}", e.what()), {}});
  }
  if (file.text_attribute(kGroup, "digest").value_or("") != digest(c))
    throw InputError(Problem{file.path(), 0, 0, kGroup, "is damaged", "a state that has its digest"});
  return c;
}

}  // namespace terrode::recording
