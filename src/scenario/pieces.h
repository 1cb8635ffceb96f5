// Convex pieces in a file: a list of lists of points [x, y, z].
#pragma once

#include <string>
#include <vector>

#include "scenario/table.h"

namespace terrode::scenario {

using Pieces = std::vector<std::vector<Vec3>>;

// The pieces at a key; empty, and a problem, where they are no hulls that wheel::ConvexPieces takes.
Pieces read_pieces(MapReader& map, const std::string& key);
std::optional<Node> write_pieces(const Pieces& pieces);
Json pieces_schema(const std::string& text);

template <class T>
typename Table<T>::Key pieces_key(const std::string& name, Pieces T::*member, const std::string& text) {
  return {name, false, pieces_schema(text), [=](MapReader& map, T& out) { out.*member = read_pieces(map, name); },
          [=](const T& in) { return write_pieces(in.*member); }};
}

}  // namespace terrode::scenario
