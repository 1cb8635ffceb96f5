// MATLAB files, versions 5 to 7.3, by libmatio.
#pragma once

#include <string>

#include "recording/csv.h"

namespace terrode::recording {

// The numeric vectors of a MATLAB file as columns, named as the variables. `group` names a structure ("data" or
// "data.run1") whose fields are the columns; "" takes the variables of the file, and the fields of a structure when it
// is the only variable. Of a matrix each column becomes one, named "variable_1", "variable_2", ... A variable
// `X_unit` of text gives the unit of X. Columns shorter than the longest are a problem; single values are left out.
// Throws InputError where the file is missing, is no MATLAB file, or holds no numeric vector.
CsvTable read_mat_columns(const std::string& path, const std::string& group);

}  // namespace terrode::recording
