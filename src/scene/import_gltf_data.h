// The binary half of a glTF file: buffers, views and accessors, each checked against the bytes that are there
// before anything is allocated for it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "scene/import_json.h"

namespace icbench::importing {

/// Decodes base64 (RFC 4648), white space ignored. Throws std::runtime_error with a reason.
std::string decode_base64(std::string_view text);

class GltfData {
 public:
  /// `binary` is the BIN chunk of a .glb file or empty; it and the document must outlive this. Throws
  /// std::runtime_error with the place, as do all functions here.
  GltfData(const Element& document, std::string_view binary, const std::filesystem::path& file);

  /// Bytes of all buffers, those of one file counted once however many name it.
  std::size_t bytes() const noexcept { return bytes_; }

  /// Bytes of a buffer view.
  std::string_view view(const Element& index) const;

  /// Bytes behind a URI: base64 in the file or a file beside it.
  std::string load(const Element& uri) const;

  /// An accessor's values one after the other, normalised integers as what they stand for; all finite.
  /// `components` is the number an element must have; `count` receives the number of elements.
  std::vector<float> floats(const Element& index, int components, std::size_t& count) const;

  /// An accessor's elements of one unsigned integer each.
  std::vector<std::uint32_t> indices(const Element& index) const;

 private:
  struct Layout {
    std::string_view bytes;  // of the elements, from the first on; empty: zeros
    std::size_t count, stride, components, component_size;
    std::uint64_t component_type;
    bool normalised;
  };

  std::string source_of(const Element& uri) const;
  Layout layout(const Element& accessor) const;
  Layout within(const Element& place, std::string_view bytes, std::uint64_t offset, Layout layout) const;
  static double component(const Layout& layout, std::size_t element, std::size_t component);
  static std::uint32_t whole(const Layout& layout, std::size_t element);
  template <class T, class Get>
  void read(const Element& accessor, const Layout& layout, std::vector<T>& out, Get get) const;

  const Element document_;
  std::filesystem::path folder_;
  std::map<std::string, std::string> loaded_;  // by source_of
  std::vector<std::string_view> buffers_;
  std::size_t bytes_ = 0;
  mutable std::size_t zeros_ = 0;  // elements read of accessors without bytes
};

}  // namespace icbench::importing
