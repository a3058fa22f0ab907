// Encodes a sequence of meshes into a callback, as a server would send it: a box that slides.
//
//     encode_meshes OUT.isv [FRAMES]
#include "isv_cpp.hpp"

#include <array>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <vector>

namespace {

struct Mesh {
    std::vector<float> positions;
    std::vector<std::uint8_t> colours;
    std::vector<std::uint32_t> indices;
};

// A box of 40 x 40 x 40 cm whose lowest corner is at x (m).
Mesh make_box(float x)
{
    Mesh mesh;
    for (unsigned corner = 0; corner < 8; corner++) {
        const std::array<bool, 3> is_high{(corner & 1) != 0, (corner & 2) != 0, (corner & 4) != 0};
        for (std::size_t axis = 0; axis < 3; axis++) {
            mesh.positions.push_back((axis == 0 ? x : 0.0f) + (is_high[axis] ? 0.4f : 0.0f));
            mesh.colours.push_back(is_high[axis] ? 230 : 40);
        }
    }
    const std::array<std::array<std::uint32_t, 4>, 6> faces{
        {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
    for (const auto &[a, b, c, d] : faces) {
        mesh.indices.insert(mesh.indices.end(), {a, b, c, a, c, d});
    }
    return mesh;
}

// No exception may leave a callback, and none can: the stream does not throw unless it is told to.
std::int32_t write(void *user, const std::uint8_t *bytes, std::size_t size)
{
    auto &file = *static_cast<std::ofstream *>(user);
    file.write(reinterpret_cast<const char *>(bytes), static_cast<std::streamsize>(size));
    return file ? 0 : 1;
}

void encode(const char *path, int frames)
{
    std::ofstream file(path, std::ios::binary);

    isv_encode_options *made = nullptr;
    isv_cpp::check(isv_encode_options_new(&made));
    const isv_cpp::Options options(made);
    isv_cpp::check(isv_encode_options_set_bitrate(options.get(), 500e3));
    isv_cpp::check(isv_encode_options_set_voxel(options.get(), 0.02));
    isv_cpp::check(isv_encode_options_set_preset(options.get(), ISV_PRESET_REALTIME));

    isv_writer *created = nullptr;
    isv_cpp::check(isv_writer_create_callback(write, &file, options.get(), &created));
    const isv_cpp::Writer writer(created);
    for (int frame = 0; frame < frames; frame++) {
        const Mesh box = make_box(0.01f * static_cast<float>(frame));
        auto mesh = isv_cpp::sized<isv_mesh>();
        mesh.vertex_count = box.positions.size() / 3;
        mesh.triangle_count = box.indices.size() / 3;
        mesh.positions = box.positions.data();
        mesh.colours = box.colours.data();
        mesh.indices = box.indices.data();
        isv_cpp::check(isv_writer_push_mesh(writer.get(), &mesh));
    }
    auto report = isv_cpp::sized<isv_report>();
    isv_cpp::check(isv_writer_finish(writer.get(), &report));
    std::cout << report.frames << " frames, " << report.bytes << " bytes, " << report.bits_per_second / 1e6 << " Mbps\n";
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 2) {
        std::cerr << "name the stream to write\n";
        return 2;
    }
    try {
        encode(argv[1], argc > 2 ? std::atoi(argv[2]) : 30);
    } catch (const std::exception &error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
    // Handles are numbers: memory checkers see no leak of one.
    if (isv_live_handles() != 0) {
        std::cerr << isv_live_handles() << " handles were not freed\n";
        return 1;
    }
    return 0;
}
