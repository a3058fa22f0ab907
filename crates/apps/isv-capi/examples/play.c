/* Plays a stream into a vertex buffer and an index buffer, as an engine would upload them.
 *
 *     play TAKE.isv [ROUNDS]
 *
 * Prints what there is of each frame. With ROUNDS it decodes the take that often, and prints the time of each round alone.
 */
#define _POSIX_C_SOURCE 199309L
#include <isv.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* 28 bytes: what shaders often take. */
typedef struct {
    float position[3];
    float normal[3];
    uint8_t colour[4];
} vertex;

typedef struct {
    vertex *vertices;
    uint32_t *indices;
    size_t vertex_room, index_room;
    size_t vertex_count, index_count;
} buffers;

static int failed(isv_status status)
{
    if (status >= ISV_OK) {
        return 0;
    }
    fprintf(stderr, "%s: %s\n", isv_status_name(status), isv_error_message());
    return 1;
}

/* Makes room in the buffers, which only ever grow. Returns 0 if there is no memory. */
static int make_room(buffers *to, size_t vertices, size_t indices)
{
    if (vertices > to->vertex_room) {
        vertex *larger = realloc(to->vertices, vertices * sizeof *larger);
        if (!larger) {
            return 0;
        }
        to->vertices = larger;
        to->vertex_room = vertices;
    }
    if (indices > to->index_room) {
        uint32_t *larger = realloc(to->indices, indices * sizeof *larger);
        if (!larger) {
            return 0;
        }
        to->indices = larger;
        to->index_room = indices;
    }
    return 1;
}

/* Copies a mesh into the buffers. Returns 0 if there is no memory. */
static int upload(const isv_mesh *mesh, buffers *to)
{
    if (!make_room(to, mesh->vertex_count, 3 * mesh->triangle_count)) {
        fprintf(stderr, "out of memory\n");
        return 0;
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        vertex *at = &to->vertices[v];
        memcpy(at->position, mesh->positions + 3 * v, sizeof at->position);
        memcpy(at->normal, mesh->normals + 3 * v, sizeof at->normal);
        memset(at->colour, 255, sizeof at->colour);
        if (mesh->colours) {
            memcpy(at->colour, mesh->colours + 3 * v, 3);
        }
    }
    if (mesh->triangle_count > 0) {
        memcpy(to->indices, mesh->indices, 3 * mesh->triangle_count * sizeof *to->indices);
    }
    to->vertex_count = mesh->vertex_count;
    to->index_count = 3 * mesh->triangle_count;
    return 1;
}

/* Plays all frames from the reader's next one on. Returns 0 after an error. */
static int play(isv_reader *reader, buffers *to, int prints)
{
    isv_frame *frame = NULL;
    isv_status status;
    while ((status = isv_reader_next_frame(reader, &frame)) == ISV_OK) {
        isv_frame_info info = {0};
        info.struct_size = sizeof info;
        isv_mesh mesh = {0};
        mesh.struct_size = sizeof mesh;
        int is_good = !failed(isv_frame_get_info(frame, &info)) && !failed(isv_frame_get_mesh(frame, &mesh)) &&
                      upload(&mesh, to);
        if (is_good && prints) {
            printf("frame %llu at %.3f s: %zu vertices, %zu indices\n", (unsigned long long)info.number,
                   (double)info.timestamp_ns / 1e9, to->vertex_count, to->index_count);
        }
        isv_frame_free(frame);
        if (!is_good) {
            return 0;
        }
    }
    return !failed(status);
}

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "name the stream to play\n");
        return 2;
    }
    int rounds = argc > 2 ? atoi(argv[2]) : 0;

    isv_reader *reader = NULL;
    buffers to = {0};
    isv_stream_info info = {0};
    info.struct_size = sizeof info;
    int result = 1;
    if (failed(isv_reader_open(argv[1], &reader)) || failed(isv_reader_info(reader, &info))) {
        goto end;
    }
    if (rounds == 0) {
        printf("%lld frames at %g a second, voxels of %g m, %s\n", (long long)info.frame_count, info.fps, info.voxel_m,
               info.has_colour ? "in colour" : "without colour");
        if (!play(reader, &to, 1)) {
            goto end;
        }
        /* Once more from the middle, at half the resolution. */
        if (info.frame_count > 0 &&
            (failed(isv_reader_seek(reader, (uint64_t)info.frame_count / 2)) || failed(isv_reader_set_lod(reader, 2)) ||
             !play(reader, &to, 1))) {
            goto end;
        }
    }
    for (int round = 0; round < rounds; round++) {
        double start = seconds();
        if (failed(isv_reader_seek(reader, 0)) || !play(reader, &to, 0)) {
            goto end;
        }
        printf("%.6f\n", seconds() - start);
    }
    result = 0;
end:
    free(to.vertices);
    free(to.indices);
    isv_reader_free(reader);
    /* Handles are numbers: memory checkers see no leak of one. */
    if (isv_live_handles() != 0) {
        fprintf(stderr, "%zu handles were not freed\n", isv_live_handles());
        result = 1;
    }
    return result;
}
