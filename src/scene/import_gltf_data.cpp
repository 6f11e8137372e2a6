#include "scene/import_gltf_data.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "files/input_file.h"
#include "scene/import_text.h"

namespace icbench::importing {
namespace {

// Most elements in all of accessors that have no bytes of their own, beyond those that the buffers could hold.
constexpr std::size_t kMostZeros = std::size_t{1} << 16;

std::size_t component_size(const Element& type) {
  switch (type.whole()) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      type.fail("is no component type of glTF 2.0");
  }
}

std::size_t component_count(const Element& type) {
  constexpr std::pair<std::string_view, std::size_t> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
  for (const auto& [name, count] : kTypes)
    if (type.text() == name) return count;
  type.fail("is no accessor type of glTF 2.0");
}

template <class T>
T load_as(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

// A normalised integer of glTF 2.0, section 3.6.2.2.
template <class T>
double scaled(const char* bytes, bool normalised) {
  const auto value = static_cast<double>(load_as<T>(bytes));
  return normalised ? std::max(value / static_cast<double>(std::numeric_limits<T>::max()), -1.0) : value;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string unescaped(std::string_view uri) {
  std::string path;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const int high = uri[i] == '%' && i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (low >= 0) i += 2;
    path += low >= 0 ? static_cast<char>(16 * high + low) : uri[i];
  }
  return path;
}

}  // namespace

std::string decode_base64(std::string_view text) {
  static const std::array<std::int8_t, 256> digits = [] {
    std::array<std::int8_t, 256> table;
    table.fill(-1);
    constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (std::size_t i = 0; i < 64; ++i)
      table[static_cast<unsigned char>(kAlphabet[i])] = static_cast<std::int8_t>(i);
    return table;
  }();
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;
  bool padded = false;
  for (const char c : text) {
    if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
    padded = padded || c == '=';
    const int digit = digits[static_cast<unsigned char>(c)];
    if (c == '=') continue;
    if (digit < 0 || padded) throw std::runtime_error("is not base64");
    bits = (bits << 6 | static_cast<std::uint32_t>(digit)) & 0xffffff;
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes += static_cast<char>(bits >> held & 0xff);
    }
  }
  return bytes;
}

GltfData::GltfData(const Element& document, std::string_view binary, const std::filesystem::path& file)
    : document_(document), folder_(file.parent_path()), bytes_(binary.size()) {
  const std::size_t count = document.items("buffers");
  for (std::size_t i = 0; i < count; ++i) {
    const Element buffer = document.at("buffers")[i];
    const std::uint64_t length = buffer.at("byteLength").whole();
    std::string_view bytes = i == 0 ? binary : std::string_view();
    if (const auto uri = buffer.find("uri")) {
      const auto [held, first] = loaded_.try_emplace(source_of(*uri));
      if (first) bytes_ += (held->second = load(*uri)).size();
      bytes = held->second;
    }
    if (length > bytes.size())
      buffer.fail(fmt::format("has {} bytes of the {} that it claims", bytes.size(), length));
    buffers_.push_back(bytes.substr(0, length));
  }
}

// What tells apart where the bytes come from, however a file's path is spelt.
std::string GltfData::source_of(const Element& uri) const {
  const std::string& text = uri.text();
  return text.starts_with("data:") ? text : (folder_ / unescaped(text)).lexically_normal().string();
}

std::string GltfData::load(const Element& uri) const {
  const std::string& text = uri.text();
  try {
    if (text.starts_with("data:")) {
      const std::size_t comma = text.find(',');
      if (comma == std::string::npos || text.substr(0, comma).find(";base64") == std::string::npos)
        throw std::runtime_error("is a data URI without base64");
      return decode_base64(std::string_view(text).substr(comma + 1));
    }
    if (text.find("://") != std::string::npos)
      throw std::runtime_error("is not a local file; put it beside the scene");
    const std::string name = unescaped(text);
    if (name.find('\0') != name.npos) throw std::runtime_error("holds a NUL; mend it");
    return load_file(folder_ / name);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(one_line(fmt::format("{}: {}", uri.place(), error.what())));
  }
}

std::string_view GltfData::view(const Element& index) const {
  const Element views = document_.at("bufferViews");
  const Element view = views[index.index(views.size())];
  const std::string_view buffer = buffers_[view.at("buffer").index(buffers_.size())];
  const std::uint64_t offset = view.whole("byteOffset", 0), length = view.at("byteLength").whole();
  if (offset > buffer.size() || length > buffer.size() - offset)
    view.fail(fmt::format("reaches byte {} of a buffer of {}", offset + length, buffer.size()));
  return buffer.substr(offset, length);
}

GltfData::Layout GltfData::within(const Element& place, std::string_view bytes, std::uint64_t offset,
                                  Layout layout) const {
  const std::size_t element = layout.components * layout.component_size;
  if (layout.count > 0 && (offset > bytes.size() || bytes.size() - offset < element ||
                           (bytes.size() - offset - element) / layout.stride < layout.count - 1))
    place.fail(fmt::format("claims {} elements of {} bytes, which its {} bytes cannot hold", layout.count,
                           element, bytes.size()));
  layout.bytes = layout.count > 0 ? bytes.substr(offset) : std::string_view();
  return layout;
}

GltfData::Layout GltfData::layout(const Element& accessor) const {
  Layout layout{};
  const Element type = accessor.at("componentType");
  layout.count = accessor.at("count").whole();
  layout.components = component_count(accessor.at("type"));
  layout.component_size = component_size(type);
  layout.component_type = type.whole();
  layout.stride = layout.components * layout.component_size;
  if (const auto n = accessor.find("normalized")) layout.normalised = n->truth();
  const auto index = accessor.find("bufferView");
  if (!index) {
    zeros_ += layout.count;
    if (zeros_ > bytes_ + kMostZeros)
      accessor.fail(fmt::format("claims {} elements of nothing; give it a bufferView", layout.count));
    return layout;
  }
  const Element view = document_.at("bufferViews")[index->whole()];
  if (const auto stride = view.find("byteStride")) {
    if (stride->whole() < layout.stride || stride->whole() > 252)
      stride->fail(fmt::format("is {}; elements of {} bytes need {} to 252", stride->whole(), layout.stride,
                               layout.stride));
    layout.stride = stride->whole();
  }
  return within(accessor, this->view(*index), accessor.whole("byteOffset", 0), layout);
}

double GltfData::component(const Layout& l, std::size_t element, std::size_t c) {
  if (l.bytes.empty()) return 0.0;
  const char* at = l.bytes.data() + element * l.stride + c * l.component_size;
  switch (l.component_type) {
    case 5120:
      return scaled<std::int8_t>(at, l.normalised);
    case 5121:
      return scaled<std::uint8_t>(at, l.normalised);
    case 5122:
      return scaled<std::int16_t>(at, l.normalised);
    case 5123:
      return scaled<std::uint16_t>(at, l.normalised);
    case 5125:
      return scaled<std::uint32_t>(at, l.normalised);
    default:
      return load_as<float>(at);
  }
}

std::uint32_t GltfData::whole(const Layout& l, std::size_t element) {
  if (l.bytes.empty()) return 0;
  const char* at = l.bytes.data() + element * l.stride;
  if (l.component_size == 1) return load_as<std::uint8_t>(at);
  return l.component_size == 2 ? load_as<std::uint16_t>(at) : load_as<std::uint32_t>(at);
}

// All elements by get(layout, element, component), then those that a sparse accessor puts in their place.
template <class T, class Get>
void GltfData::read(const Element& accessor, const Layout& layout, std::vector<T>& out, Get get) const {
  out.reserve(layout.count * layout.components);
  for (std::size_t i = 0; i < layout.count; ++i)
    for (std::size_t c = 0; c < layout.components; ++c) out.push_back(get(layout, i, c));
  const auto sparse = accessor.find("sparse");
  if (!sparse) return;
  const Element at = sparse->at("indices"), values = sparse->at("values");
  Layout where{};
  where.count = sparse->at("count").whole();
  where.components = 1;
  where.component_type = at.at("componentType").whole();
  where.stride = where.component_size = component_size(at.at("componentType"));
  where = within(at, view(at.at("bufferView")), at.whole("byteOffset", 0), where);
  Layout what = layout;
  what.count = where.count;
  what.stride = layout.components * layout.component_size;
  what = within(values, view(values.at("bufferView")), values.whole("byteOffset", 0), what);
  for (std::size_t i = 0; i < where.count; ++i) {
    const std::size_t element = whole(where, i);
    if (element >= layout.count) at.fail(fmt::format("names element {} of {}", element, layout.count));
    for (std::size_t c = 0; c < layout.components; ++c)
      out[element * layout.components + c] = get(what, i, c);
  }
}

std::vector<float> GltfData::floats(const Element& index, int components, std::size_t& count) const {
  const Element accessors = document_.at("accessors");
  const Element accessor = accessors[index.index(accessors.size())];
  const Layout layout = this->layout(accessor);
  if (layout.components != static_cast<std::size_t>(components))
    accessor.fail(
        fmt::format("has {} components; {} needs {}", layout.components, index.place(), components));
  std::vector<float> out;
  read(accessor, layout, out, [&](const Layout& l, std::size_t i, std::size_t c) {
    const double value = component(l, i, c);
    if (!std::isfinite(value)) accessor.fail(fmt::format("has an element {} that is not finite", i));
    return static_cast<float>(value);
  });
  count = layout.count;
  return out;
}

std::vector<std::uint32_t> GltfData::indices(const Element& index) const {
  const Element accessors = document_.at("accessors");
  const Element accessor = accessors[index.index(accessors.size())];
  const Layout layout = this->layout(accessor);
  if (layout.components != 1 || layout.component_type == 5126)
    accessor.fail("holds indices, which are single whole numbers");
  std::vector<std::uint32_t> out;
  read(accessor, layout, out, [](const Layout& l, std::size_t i, std::size_t) { return whole(l, i); });
  return out;
}

}  // namespace icbench::importing
