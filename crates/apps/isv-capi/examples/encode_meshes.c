/* Encodes a sequence of meshes with colours, frame by frame: a ball that bounces.
 *
 *     encode_meshes OUT.isv [FRAMES]
 */
#include <isv.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define RINGS 24
#define SECTORS 48
#define VERTICES ((RINGS + 1) * SECTORS)
#define TRIANGLES (2 * RINGS * SECTORS)

static float positions[3 * VERTICES];
static uint8_t colours[3 * VERTICES];
static uint32_t indices[3 * TRIANGLES];

/* Fills the arrays with a ball of radius 25 cm whose middle is at a height (m). */
static void make_ball(float height)
{
    const float pi = 3.14159265f;
    size_t v = 0, i = 0;
    for (int ring = 0; ring <= RINGS; ring++) {
        for (int sector = 0; sector < SECTORS; sector++, v++) {
            float polar = pi * (float)ring / RINGS, around = 2 * pi * (float)sector / SECTORS;
            positions[3 * v] = 0.25f * sinf(polar) * cosf(around);
            positions[3 * v + 1] = 0.25f * cosf(polar) + height;
            positions[3 * v + 2] = 0.25f * sinf(polar) * sinf(around);
            colours[3 * v] = (uint8_t)(255 * sector / SECTORS);
            colours[3 * v + 1] = (uint8_t)(255 * ring / RINGS);
            colours[3 * v + 2] = 128;
        }
    }
    for (uint32_t ring = 0; ring < RINGS; ring++) {
        for (uint32_t sector = 0; sector < SECTORS; sector++) {
            uint32_t next = (sector + 1) % SECTORS, upper = ring * SECTORS, lower = upper + SECTORS;
            /* Counter-clockwise seen from outside. */
            const uint32_t two[6] = {upper + sector, upper + next, lower + sector,
                                     upper + next,   lower + next, lower + sector};
            for (int corner = 0; corner < 6; corner++) {
                indices[i++] = two[corner];
            }
        }
    }
}

static void on_event(void *user, int32_t is_warning, const char *text)
{
    (void)user;
    fprintf(stderr, "%s%s\n", is_warning ? "warning: " : "", text);
}

static int failed(isv_status status)
{
    if (status >= ISV_OK) {
        return 0;
    }
    fprintf(stderr, "%s: %s\n", isv_status_name(status), isv_error_message());
    return 1;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "name the stream to write\n");
        return 2;
    }
    int frames = argc > 2 ? atoi(argv[2]) : 30;

    isv_encode_options *options = NULL;
    isv_writer *writer = NULL;
    isv_report report = {0};
    report.struct_size = sizeof report;
    isv_mesh mesh = {0};
    mesh.struct_size = sizeof mesh;
    mesh.vertex_count = VERTICES;
    mesh.triangle_count = TRIANGLES;
    mesh.positions = positions;
    mesh.colours = colours;
    mesh.indices = indices;

    int result = 1;
    if (failed(isv_encode_options_new(&options)) || failed(isv_encode_options_set_quality(options, 60.0f)) ||
        failed(isv_encode_options_set_voxel(options, 0.01)) || failed(isv_encode_options_set_fps(options, 30.0)) ||
        failed(isv_encode_options_set_event_callback(options, on_event, NULL)) ||
        failed(isv_writer_create(argv[1], options, &writer))) {
        goto end;
    }
    for (int frame = 0; frame < frames; frame++) {
        make_ball(0.25f + 0.5f * fabsf(sinf(0.1f * (float)frame)));
        if (failed(isv_writer_push_mesh(writer, &mesh))) {
            goto end;
        }
    }
    if (failed(isv_writer_finish(writer, &report))) {
        goto end;
    }
    printf("%llu frames, %llu bytes, %.3f Mbps\n", (unsigned long long)report.frames,
           (unsigned long long)report.bytes, report.bits_per_second / 1e6);
    result = 0;
end:
    isv_writer_free(writer);
    isv_encode_options_free(options);
    /* Handles are numbers: memory checkers see no leak of one. */
    if (isv_live_handles() != 0) {
        fprintf(stderr, "%zu handles were not freed\n", isv_live_handles());
        result = 1;
    }
    return result;
}
