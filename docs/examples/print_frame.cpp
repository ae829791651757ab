// Prints what a message holds that was saved to a file: c++ -std=c++17 print_frame.cpp -o print_frame
#include "gellight_frame.hpp"

#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

int main(int count, char** arguments) {
    std::ifstream file(count > 1 ? arguments[1] : "", std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    gellight::Frame frame;
    const auto* message = reinterpret_cast<const std::uint8_t*>(bytes.data());
    if (const auto why = gellight::decode(message, bytes.size(), frame); !why.empty()) {
        std::fprintf(stderr, "%s\n", why.c_str());
        return 1;
    }
    double depth = 0, slope = 0, image = 0, touched = 0, pressure = 0, confidence = 0, quality_flags = 0;
    const std::size_t pixels = std::size_t{frame.width} * frame.height;
    for (std::size_t k = 0; k < pixels; ++k) {
        depth += frame.depth_mm[k];
        slope += frame.gradient[2 * k];
        image += frame.image[3 * k];
        touched += frame.contact[k];
        if (frame.pressure_mpa) pressure += frame.pressure_mpa[k];
        if (frame.confidence) confidence += frame.confidence[k];
        if (frame.quality_flags) quality_flags += frame.quality_flags[k];
    }
    std::printf("%lld %u %u %.17g %.17g %.17g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
                static_cast<long long>(frame.sequence),
                frame.width, frame.height, frame.time_s, frame.indentation_mm, frame.centroid_x_mm, depth, slope, image,
                touched, pressure, confidence, quality_flags);
    std::printf("%.*s\n", static_cast<int>(frame.details.size()), frame.details.data());
}
