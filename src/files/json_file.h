// Writing JSON as a file of its own.
#pragma once

#include <nlohmann/json.hpp>

#include "files/output_file.h"

namespace icbench {

/// Puts `json` under `path` as write_file does. Bytes of it that are no UTF-8, as names of files may have them, become
/// U+FFFD.
template <class Json>
void write_json(const std::filesystem::path& path, const Json& json, int indent = 2) {
  write_file(path, json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace icbench
