// Reads the message that carries one tactile frame; docs/wire-format.md describes it. C++17, no dependencies.
//
// A little-endian computer is assumed, as x86 and ARM are. Nothing is copied: the pointers point into the message.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace gellight {

constexpr std::uint16_t kVersion = 1;

struct Frame {
    std::int64_t sequence;
    double time_s, unix_s;  // start of the exposure: monotonic clock of the daemon's computer, and Unix time
    std::uint32_t width, height;
    double pixel_x_mm, pixel_y_mm;
    double indentation_mm, area_mm2;
    double centroid_x_mm, centroid_y_mm;  // NaN where nothing touches
    const std::uint8_t* image;            // height * width * 3, RGB
    const float* gradient;                // height * width * 2: d(depth)/dx, d(depth)/dy
    const float* depth_mm;                // height * width, positive into the sensor
    const std::uint8_t* contact;          // height * width, 1 where something touches
    const float* pressure_mpa;            // height * width, N / mm2; null unless asked for and known
    const float* confidence;              // height * width, 0.05 to 1; null unless asked for
    const std::uint8_t* quality_flags;    // height * width, why it is below 1; null unless asked for
    std::string_view details;             // JSON
};

namespace detail {

template <typename T>
T read(const std::uint8_t* message, std::size_t place) {
    T value;
    std::memcpy(&value, message + place, sizeof value);
    return value;
}

}  // namespace detail

// Returns an empty text, or why the message is refused; then `frame` must not be used.
// `message` has to be aligned to 4 bytes, and to live as long as `frame`.
inline std::string decode(const std::uint8_t* message, std::size_t size, Frame& frame) {
    using detail::read;
    constexpr std::size_t prefix = 96, entry = 32;
    if (size < prefix || std::memcmp(message, "GELT", 4) != 0) return "no frame of GelLight";
    const auto version = read<std::uint16_t>(message, 4);
    if (version != kVersion) return "version " + std::to_string(version) + ", this program reads 1: update it";
    const auto planes = read<std::uint16_t>(message, 6);
    const auto details_at = read<std::uint32_t>(message, 8), details_size = read<std::uint32_t>(message, 12);
    frame = Frame{};
    frame.sequence = read<std::int64_t>(message, 16);
    frame.time_s = read<double>(message, 24);
    frame.unix_s = read<double>(message, 32);
    frame.width = read<std::uint32_t>(message, 40);
    frame.height = read<std::uint32_t>(message, 44);
    frame.pixel_x_mm = read<double>(message, 48);
    frame.pixel_y_mm = read<double>(message, 56);
    frame.indentation_mm = read<double>(message, 64);
    frame.area_mm2 = read<double>(message, 72);
    frame.centroid_x_mm = read<double>(message, 80);
    frame.centroid_y_mm = read<double>(message, 88);
    if (frame.width == 0 || frame.height == 0 || frame.width > 8192 || frame.height > 8192) return "damaged: its size";
    if (planes > 16 || size < prefix + entry * planes) return "damaged: the list of planes";
    if (details_at > size || details_size > size - details_at) return "damaged: the details";
    frame.details = {reinterpret_cast<const char*>(message) + details_at, details_size};
    for (std::size_t at = prefix; at < prefix + entry * planes; at += entry) {
        const std::string_view name(reinterpret_cast<const char*>(message) + at,
                                    strnlen(reinterpret_cast<const char*>(message) + at, 16));
        const auto type = read<std::uint32_t>(message, at + 16), channels = read<std::uint32_t>(message, at + 20);
        const auto place = read<std::uint64_t>(message, at + 24);
        if ((type != 1 && type != 2) || channels == 0 || channels > 4 || place % 16) return "damaged: a plane";
        const std::uint64_t bytes = std::uint64_t{frame.width} * frame.height * channels * (type == 2 ? 4 : 1);
        if (place > size || bytes > size - place) return "damaged: a plane";
        const std::uint8_t* plane = message + place;
        if (name == "image" && type == 1 && channels == 3) frame.image = plane;
        if (name == "contact" && type == 1 && channels == 1) frame.contact = plane;
        if (name == "gradient" && type == 2 && channels == 2) frame.gradient = reinterpret_cast<const float*>(plane);
        if (name == "depth_mm" && type == 2 && channels == 1) frame.depth_mm = reinterpret_cast<const float*>(plane);
        if (name == "pressure_mpa" && type == 2 && channels == 1)
            frame.pressure_mpa = reinterpret_cast<const float*>(plane);
        if (name == "confidence" && type == 2 && channels == 1) frame.confidence = reinterpret_cast<const float*>(plane);
        if (name == "quality_flags" && type == 1 && channels == 1) frame.quality_flags = plane;
    }
    if (!frame.image || !frame.contact || !frame.gradient || !frame.depth_mm) return "damaged: a plane is missing";
    return "";
}

}  // namespace gellight
