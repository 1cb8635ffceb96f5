// Whether a MATLAB file is what libmatio may be given. The library takes a file at its word: it asks for, and clears, as much
// memory as the dimensions say, whether or not the values are there.
#pragma once

#include <string>

namespace terrode::recording {

// Walks through a MATLAB file of version 5 (MAT-File Format, The MathWorks, R2020b, chapter 1) or 7.3 (HDF5) without keeping
// its values. Compressed variables are unpacked on the way. Throws InputError unless each element lies within the one that
// holds it, each array has as many values as its dimensions say, structures nest at most 16 deep, and all values together
// take at most 1 GiB once unpacked.
void check_mat_file(const std::string& path);

}  // namespace terrode::recording
