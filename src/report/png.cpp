#include "report/png.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace terrode::report {
namespace {

void put32(std::string& out, std::uint32_t v) {
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(static_cast<unsigned char>(v >> shift));
}

std::uint32_t crc32(const std::string& bytes) {
  static const auto table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = (c & 1u) ? 0xEDB88320u ^ (c >> 1) : c >> 1;
      t[n] = c;
    }
    return t;
  }();
  std::uint32_t c = 0xFFFFFFFFu;
  for (char byte : bytes) c = table[(c ^ static_cast<unsigned char>(byte)) & 0xFFu] ^ (c >> 8);
  return ~c;
}

void chunk(std::string& out, const std::string& type, const std::string& data) {
  put32(out, static_cast<std::uint32_t>(data.size()));
  out += type + data;
  put32(out, crc32(type + data));
}

std::string stored(const std::string& data) {
  std::string out = "\x78\x01";
  constexpr size_t kBlock = 65535;
  for (size_t at = 0; at < data.size() || at == 0; at += kBlock) {
    const size_t n = std::min(kBlock, data.size() - at);
    out += static_cast<char>(at + n >= data.size() ? 1 : 0);
    for (size_t v : {n, ~n}) {
      out += static_cast<char>(static_cast<unsigned char>(v & 0xFFu));
      out += static_cast<char>(static_cast<unsigned char>((v >> 8) & 0xFFu));
    }
    out += data.substr(at, n);
  }
  std::uint32_t a = 1, b = 0;
  for (char c : data) {
    a = (a + static_cast<unsigned char>(c)) % 65521u;
    b = (b + a) % 65521u;
  }
  put32(out, (b << 16) | a);
  return out;
}

}  // namespace

std::string base64(const std::string& bytes) {
  static const char* alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t v = 0;
    for (size_t k = 0; k < 3; ++k) v = (v << 8) | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) out += i + k <= bytes.size() ? alphabet[(v >> (18 - 6 * k)) & 63u] : '=';
  }
  return out;
}

std::string png_base64(size_t width, size_t height, const std::vector<palette::Rgb>& colours, const std::vector<bool>& filled) {
  std::string rows;
  rows.reserve((4 * width + 1) * height);
  for (size_t y = 0; y < height; ++y) {
    rows += '\0';
    for (size_t x = 0; x < width; ++x) {
      const size_t i = y * width + x;
      const palette::Rgb c = filled[i] ? colours[i] : palette::Rgb{0, 0, 0};
      for (unsigned char byte : {c.r, c.g, c.b, static_cast<unsigned char>(filled[i] ? 255 : 0)}) rows += static_cast<char>(byte);
    }
  }
  std::string header;
  put32(header, static_cast<std::uint32_t>(width));
  put32(header, static_cast<std::uint32_t>(height));
  header += std::string("\x08\x06\x00\x00\x00", 5);
  std::string out = "\x89PNG\r\n\x1a\n";
  chunk(out, "IHDR", header);
  chunk(out, "IDAT", stored(rows));
  chunk(out, "IEND", "");
  return base64(out);
}

}  // namespace terrode::report
