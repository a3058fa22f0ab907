// What the C++ examples share: handles that free themselves, and errors as exceptions.
#pragma once

#include <isv.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace isv_cpp {

struct Free {
    void operator()(isv_encode_options *handle) const { isv_encode_options_free(handle); }
    void operator()(isv_writer *handle) const { isv_writer_free(handle); }
    void operator()(isv_reader *handle) const { isv_reader_free(handle); }
    void operator()(isv_frame *handle) const { isv_frame_free(handle); }
};

using Options = std::unique_ptr<isv_encode_options, Free>;
using Writer = std::unique_ptr<isv_writer, Free>;
using Reader = std::unique_ptr<isv_reader, Free>;
using Frame = std::unique_ptr<isv_frame, Free>;

inline isv_status check(isv_status status)
{
    if (status < ISV_OK) {
        throw std::runtime_error(std::string(isv_status_name(status)) + ": " + isv_error_message());
    }
    return status;
}

// A struct that states its size; the rest is 0.
template <typename Struct>
Struct sized()
{
    Struct value{};
    value.struct_size = sizeof value;
    return value;
}

} // namespace isv_cpp
