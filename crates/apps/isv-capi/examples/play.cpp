// Plays a stream: one thread decodes ahead, another one fills vertex buffers. The bytes come from callbacks.
//
//     play TAKE.isv
#include "isv_cpp.hpp"

#include <condition_variable>
#include <deque>
#include <exception>
#include <fstream>
#include <iostream>
#include <mutex>
#include <thread>
#include <vector>

namespace {

std::int64_t read(void *user, std::uint8_t *bytes, std::size_t size)
{
    auto &file = *static_cast<std::ifstream *>(user);
    file.read(reinterpret_cast<char *>(bytes), static_cast<std::streamsize>(size));
    return file.bad() ? -1 : static_cast<std::int64_t>(file.gcount());
}

std::int64_t seek(void *user, std::int64_t offset, std::int32_t whence)
{
    auto &file = *static_cast<std::ifstream *>(user);
    file.clear();
    const auto from = whence == ISV_SEEK_START ? std::ios::beg : whence == ISV_SEEK_END ? std::ios::end : std::ios::cur;
    file.seekg(offset, from);
    return file ? static_cast<std::int64_t>(file.tellg()) : -1;
}

// Frames that were decoded and not yet shown: a few, so that memory stays what it is.
class Queue {
public:
    void push(isv_cpp::Frame frame)
    {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return frames_.size() < 3 || is_closed_; });
        frames_.push_back(std::move(frame));
        changed_.notify_all();
    }

    // Null behind the last frame.
    isv_cpp::Frame pop()
    {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return !frames_.empty() || is_closed_; });
        if (frames_.empty()) {
            return nullptr;
        }
        auto frame = std::move(frames_.front());
        frames_.pop_front();
        changed_.notify_all();
        return frame;
    }

    void close()
    {
        const std::lock_guard lock(mutex_);
        is_closed_ = true;
        changed_.notify_all();
    }

private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<isv_cpp::Frame> frames_;
    bool is_closed_ = false;
};

// Decodes all frames, and makes their meshes here, so that the other thread only copies.
void decode(isv_reader *reader, Queue &queue)
{
    isv_frame *next = nullptr;
    while (isv_cpp::check(isv_reader_next_frame(reader, &next)) == ISV_OK) {
        isv_cpp::Frame frame(next);
        auto mesh = isv_cpp::sized<isv_mesh>();
        isv_cpp::check(isv_frame_get_mesh(frame.get(), &mesh));
        queue.push(std::move(frame));
    }
}

// Ends a thread in every case.
struct Joined {
    std::thread thread;
    Queue &queue;

    ~Joined() { join(); }

    void join()
    {
        queue.close();
        if (thread.joinable()) {
            thread.join();
        }
    }
};

void play(const char *path)
{
    std::ifstream file(path, std::ios::binary);
    auto source = isv_cpp::sized<isv_source>();
    source.user = &file;
    source.read = read;
    source.seek = seek;
    isv_reader *opened = nullptr;
    isv_cpp::check(isv_reader_open_source(&source, &opened));
    const isv_cpp::Reader reader(opened);

    Queue queue;
    std::exception_ptr failure;
    Joined decoder{std::thread([&] {
                       try {
                           decode(reader.get(), queue);
                       } catch (...) {
                           failure = std::current_exception();
                       }
                       queue.close();
                   }),
                   queue};

    std::vector<float> vertices;
    std::vector<std::uint32_t> indices;
    std::size_t frames = 0;
    while (const auto frame = queue.pop()) {
        auto mesh = isv_cpp::sized<isv_mesh>();
        isv_cpp::check(isv_frame_get_mesh(frame.get(), &mesh));
        vertices.assign(mesh.positions, mesh.positions + 3 * mesh.vertex_count);
        indices.assign(mesh.indices, mesh.indices + 3 * mesh.triangle_count);
        frames++;
    }
    decoder.join();
    if (failure) {
        std::rethrow_exception(failure);
    }
    std::cout << frames << " frames, the last with " << vertices.size() / 3 << " vertices and " << indices.size() / 3
              << " triangles\n";
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 2) {
        std::cerr << "name the stream to play\n";
        return 2;
    }
    try {
        play(argv[1]);
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
