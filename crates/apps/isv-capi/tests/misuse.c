/* Calls with wrong handles and arguments, for valgrind: none may read or write what it should not, or leak. */
#include <isv.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

static int errors = 0;

static void expect(int line, isv_status found, isv_status expected)
{
    if (found != expected) {
        fprintf(stderr, "line %d: %s in place of %s: %s\n", line, isv_status_name(found), isv_status_name(expected),
                isv_error_message());
        errors++;
    }
}

#define EXPECT(expected, call) expect(__LINE__, (call), (expected))

static int32_t write_nothing(void *user, const uint8_t *bytes, size_t size)
{
    (void)user, (void)bytes, (void)size;
    return 0;
}

int main(void)
{
    isv_encode_options *options = NULL;
    isv_writer *writer = NULL;
    isv_reader *reader = NULL;
    isv_frame *frame = NULL;
    int local = 0;

    EXPECT(ISV_ERROR_ARGUMENT, isv_encode_options_new(NULL));
    EXPECT(ISV_OK, isv_encode_options_new(&options));
    EXPECT(ISV_ERROR_OPTIONS, isv_encode_options_set_voxel(options, -1));
    EXPECT(ISV_ERROR_OPTIONS, isv_encode_options_set_quality(options, NAN));
    EXPECT(ISV_OK, isv_encode_options_set_voxel(options, 0.05));
    EXPECT(ISV_OK, isv_writer_create_callback(write_nothing, NULL, options, &writer));
    EXPECT(ISV_OK, isv_encode_options_free(options));
    EXPECT(ISV_ERROR_HANDLE, isv_encode_options_free(options));
    EXPECT(ISV_ERROR_HANDLE, isv_encode_options_set_voxel(options, 0.01));
    EXPECT(ISV_ERROR_HANDLE, isv_writer_free((isv_writer *)&local));
    EXPECT(ISV_ERROR_HANDLE, isv_reader_seek((isv_reader *)(void *)writer, 0));

    const float positions[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    const uint32_t indices[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    isv_mesh mesh = {0};
    mesh.vertex_count = 4;
    mesh.triangle_count = 4;
    mesh.positions = positions;
    mesh.indices = indices;
    EXPECT(ISV_ERROR_ARGUMENT, isv_writer_push_mesh(writer, &mesh));
    mesh.struct_size = sizeof mesh;
    EXPECT(ISV_OK, isv_writer_push_mesh(writer, &mesh));
    mesh.vertex_count = (size_t)-1;
    EXPECT(ISV_ERROR_ARGUMENT, isv_writer_push_mesh(writer, &mesh));
    mesh.vertex_count = 2;
    EXPECT(ISV_ERROR_FRAME, isv_writer_push_mesh(writer, &mesh));
    mesh.vertex_count = 4;
    mesh.positions = NULL;
    EXPECT(ISV_ERROR_ARGUMENT, isv_writer_push_mesh(writer, &mesh));
    EXPECT(ISV_OK, isv_writer_finish(writer, NULL));
    EXPECT(ISV_ERROR_STATE, isv_writer_finish(writer, NULL));
    EXPECT(ISV_OK, isv_writer_free(writer));
    EXPECT(ISV_ERROR_HANDLE, isv_writer_free(writer));
    EXPECT(ISV_ERROR_HANDLE, isv_writer_push_mesh(writer, &mesh));

    uint8_t bytes[64];
    memset(bytes, 0x55, sizeof bytes);
    EXPECT(ISV_ERROR_STREAM, isv_reader_open_memory(bytes, sizeof bytes, &reader));
    EXPECT(ISV_ERROR_HANDLE, isv_reader_next_frame(reader, &frame));
    EXPECT(ISV_ERROR_HANDLE, isv_frame_get_mesh(NULL, &mesh));
    EXPECT(ISV_OK, isv_frame_free(NULL));
    EXPECT(ISV_ERROR_INPUT, isv_reader_open("no/such/file.isv", &reader));
    if (isv_live_handles() != 0) {
        fprintf(stderr, "%zu handles were not freed\n", isv_live_handles());
        errors++;
    }
    return errors != 0;
}
