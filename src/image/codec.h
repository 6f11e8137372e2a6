// The file formats behind image.h: bytes to pixels and back, without any file handling.
//
// Decoding takes any bytes at all. Errors are std::runtime_error with a reason to which the caller adds the
// file's name.
#pragma once

#include <string>
#include <string_view>

#include "image/image.h"

namespace icbench {

std::string encode_exr(const Image& image, ExrSample sample);
Image decode_exr(std::string_view bytes);

std::string encode_png(const Image& image, float exposure);
/// `is_srgb`: samples are sRGB, whatever the file says of itself, as glTF 2.0 (3.8.3) has it of textures.
Image decode_png(std::string_view bytes, bool is_srgb = false);

/// Transfer function of sRGB (IEC 61966-2-1) for linear values in [0, 1], and its inverse.
float srgb_from_linear(float linear) noexcept;
float linear_from_srgb(float encoded) noexcept;

}  // namespace icbench
