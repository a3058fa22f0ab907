/*
 * isv: a codec for moving 3-D geometry. The C library.
 *
 * cbindgen makes this file from crates/apps/isv-capi/src. Change it there.
 *
 * docs/c.md tells how to build and link, and gives the rules in full. In short:
 *
 * - Calls return ISV_OK, ISV_END where nothing follows, or an error below 0. isv_error_message() has the words.
 * - A handle comes from a call with `new`, `create`, `open` or `next_frame`, and goes to the call with `free`.
 *   Null, freed and foreign handles are errors.
 * - A handle serves one call at a time, from any thread. A second call at that time returns ISV_ERROR_BUSY.
 * - Arrays that you pass in are yours, and are read during the call alone. Arrays in a frame's structs belong to the
 *   frame, and live until isv_frame_free.
 * - Set the member struct_size of each struct to its sizeof before the call. Zero the rest.
 * - Coordinates are in metres, right-handed, Y up. Text is UTF-8.
 * - Callbacks must return: no exception and no longjmp may leave them.
 */


#ifndef ISV_H
#define ISV_H

#include <stddef.h>
#include <stdint.h>

/**
 * Places counted from the start.
 */
#define ISV_SEEK_START 0

/**
 * Places counted from the present one.
 */
#define ISV_SEEK_CURRENT 1

/**
 * Places counted from the end.
 */
#define ISV_SEEK_END 2

/**
 * Major version of this header.
 */
#define ISV_VERSION_MAJOR 0

/**
 * Minor version of this header. Below version 1.0, programs must be compiled anew for each.
 */
#define ISV_VERSION_MINOR 1

/**
 * Patch version of this header.
 */
#define ISV_VERSION_PATCH 0

/**
 * Options of `isv_decode_take`. Each begins with its default, and a call that fails leaves it as it was.
 */
typedef struct isv_decode_options isv_decode_options;

/**
 * Options of encoding. Each begins with its default, and a call that fails leaves it as it was.
 *
 * Writers and jobs copy the options when they begin. Later changes do not reach them.
 */
typedef struct isv_encode_options isv_encode_options;

/**
 * A decoded frame. Its surface, points and field are made when they are first asked for, and live until the frame is freed.
 *
 * Several threads may use a frame at once. It stays good when its reader is freed.
 */
typedef struct isv_frame isv_frame;

/**
 * Reads the frames of a stream in order, or from any frame on.
 *
 * After an error `ISV_END` follows, until `isv_reader_seek` goes to a frame.
 */
typedef struct isv_reader isv_reader;

/**
 * Encodes frames one by one, to a file or a callback. All frames of a stream are of one kind.
 *
 * After `ISV_ERROR_FRAME` and `ISV_ERROR_ARGUMENT` other frames may follow. After `ISV_ERROR_OUTPUT` and `ISV_ERROR_DEVICE` none may.
 */
typedef struct isv_writer isv_writer;

/**
 * Result of a call: `ISV_OK`, `ISV_END`, or an error below 0.
 */
typedef int32_t isv_status;

/**
 * Reaction to damaged or missing packets: `ISV_AFTER_LOSS_STOP` or `ISV_AFTER_LOSS_HOLD`.
 */
typedef int32_t isv_after_loss;

/**
 * Device that does the arithmetic: `ISV_DEVICE_CPU`, `ISV_DEVICE_GPU` or `ISV_DEVICE_AUTO`.
 */
typedef int32_t isv_device;

/**
 * Takes an event: a sentence, and whether it is a warning (1) or not (0). `text` is the library's, and good during the call.
 *
 * It may be called from any thread, and from several at once. It must not wait for the call that caused it.
 */
typedef void (*isv_event_fn)(void *user, int32_t is_warning, const char *text);

/**
 * Takes the number of frames done, and of all frames, 0 if that is not known. Returns 0 to go on, or another number to stop the job.
 *
 * It is called after each frame, on the thread that started the job.
 */
typedef int32_t (*isv_progress_fn)(void *user, uint64_t done, uint64_t total);

/**
 * Amount of work for small streams: `ISV_PRESET_REALTIME`, `ISV_PRESET_BALANCED` or `ISV_PRESET_ARCHIVE`.
 */
typedef int32_t isv_preset;

/**
 * Recovery of decoders from lost packets: `ISV_REFRESH_KEYFRAMES` or `ISV_REFRESH_GRADUAL`.
 */
typedef int32_t isv_refresh;

/**
 * Rule that tells inside from outside of meshes and points: one of the numbers `ISV_SIGN_...`.
 */
typedef int32_t isv_sign;

/**
 * Source of the frames' times: one of the numbers `ISV_TIMESTAMPS_...`.
 */
typedef int32_t isv_timestamps;

/**
 * Whether a stream says what it is: `ISV_METADATA_AUTO`, `ISV_METADATA_ALWAYS` or `ISV_METADATA_NEVER`.
 */
typedef int32_t isv_metadata;

/**
 * Facts of a decoded frame.
 */
typedef struct isv_frame_info {
    /**
     * Size of this struct: set it to `sizeof(isv_frame_info)`.
     */
    size_t struct_size;
    /**
     * Number in the stream, from 0.
     */
    uint64_t number;
    /**
     * Time at which it is shown (ns), from the stream's start or, in a live stream, from 1970.
     */
    uint64_t timestamp_ns;
} isv_frame_info;

/**
 * A triangle mesh.
 *
 * Arrays of an input are the caller's, and are read during the call. Arrays of an output belong to the frame.
 */
typedef struct isv_mesh {
    /**
     * Size of this struct: set it to `sizeof(isv_mesh)`.
     */
    size_t struct_size;
    /**
     * Number of vertices.
     */
    size_t vertex_count;
    /**
     * Number of triangles.
     */
    size_t triangle_count;
    /**
     * Positions of vertices (m): x, y, z. `vertex_count` x 3 numbers.
     */
    const float *positions;
    /**
     * Unit normals: x, y, z. `vertex_count` x 3 numbers, or null. Encoding does not read them.
     */
    const float *normals;
    /**
     * 8-bit sRGB colours: red, green, blue. `vertex_count` x 3 numbers, or null.
     */
    const uint8_t *colours;
    /**
     * Vertices of each triangle, counter-clockwise seen from outside. `triangle_count` x 3 numbers below `vertex_count`.
     */
    const uint32_t *indices;
} isv_mesh;

/**
 * Points of a surface.
 *
 * Arrays of an input are the caller's, and are read during the call. Arrays of an output belong to the frame.
 */
typedef struct isv_points {
    /**
     * Size of this struct: set it to `sizeof(isv_points)`.
     */
    size_t struct_size;
    /**
     * Number of points.
     */
    size_t count;
    /**
     * Positions (m): x, y, z. `count` x 3 numbers.
     */
    const float *positions;
    /**
     * Normals that point outside: x, y, z, all 0 where one is not known. `count` x 3 numbers, or null.
     */
    const float *normals;
    /**
     * 8-bit sRGB colours: red, green, blue. `count` x 3 numbers, or null.
     */
    const uint8_t *colours;
    /**
     * Place that the points were seen from (m): x, y, z. 3 numbers, or null. Estimated normals face it. Null as an output.
     */
    const float *viewpoint;
} isv_points;

/**
 * A sparse field of signed distances (TSDF). Blocks that are not there are outside, or were not observed.
 *
 * Arrays of an input are the caller's, and are read during the call. Arrays of an output belong to the frame.
 */
typedef struct isv_volume {
    /**
     * Size of this struct: set it to `sizeof(isv_volume)`.
     */
    size_t struct_size;
    /**
     * Edge of a voxel (m).
     */
    double voxel_m;
    /**
     * Edge of a block (voxels): 4, 8 or 16.
     */
    uint32_t block_edge;
    /**
     * Distance from the surface at which distances are cut off (voxels).
     */
    uint32_t truncation_voxels;
    /**
     * Number of blocks.
     */
    size_t block_count;
    /**
     * Place of each block, in blocks: x, y, z. Its lowest corner is at place x `block_edge` x `voxel_m`. `block_count` x 3 numbers.
     */
    const int32_t *coords;
    /**
     * Distances at the centres of voxels (m), negative inside, NaN where not observed. Block by block, in each x fastest, then y, then
     * z. `block_count` x `block_edge`^3 numbers.
     */
    const float *distances;
} isv_volume;

/**
 * Gives the next bytes of a stream, at most `size` of them, into `bytes`. Returns their number, 0 at the end, or a number below 0
 * for a failure.
 *
 * It is called on the thread that opens the reader or reads a frame.
 */
typedef int64_t (*isv_read_fn)(void *user, uint8_t *bytes, size_t size);

/**
 * Goes to a place in the bytes of a stream, in bytes from where `whence` says. `ISV_SEEK_START` is their start, `ISV_SEEK_CURRENT`
 * the present place, and `ISV_SEEK_END` their end. Returns the place from the start, or a number below 0 for a failure.
 */
typedef int64_t (*isv_seek_fn)(void *user, int64_t offset, int32_t whence);

/**
 * Bytes of a stream from callbacks.
 */
typedef struct isv_source {
    /**
     * Size of this struct: set it to `sizeof(isv_source)`.
     */
    size_t struct_size;
    /**
     * Pointer that the callbacks get back.
     */
    void *user;
    /**
     * Gives the next bytes.
     */
    isv_read_fn read;
    /**
     * Goes to a place; null if the bytes come once, as from a socket. Then frames can be read in order alone.
     */
    isv_seek_fn seek;
} isv_source;

/**
 * Facts of a stream that is read.
 */
typedef struct isv_stream_info {
    /**
     * Size of this struct: set it to `sizeof(isv_stream_info)`.
     */
    size_t struct_size;
    /**
     * Number of frames; -1 if it is not known, as of a stream without seek callback or without a sound index.
     */
    int64_t frame_count;
    /**
     * Frames a second. Without a seek callback, 0 until the first frame was read.
     */
    double fps;
    /**
     * Edge of a voxel at full resolution (m). Without a seek callback, 0 until the first frame was read.
     */
    double voxel_m;
    /**
     * 1 if frames may have colour, else 0. Without a seek callback, 0 until the first frame was read.
     */
    int32_t has_colour;
    /**
     * 1 if `isv_reader_seek` works, else 0.
     */
    int32_t can_seek;
} isv_stream_info;

/**
 * Result of a stream that was written.
 */
typedef struct isv_report {
    /**
     * Size of this struct: set it to `sizeof(isv_report)`.
     */
    size_t struct_size;
    /**
     * Frames in the stream.
     */
    uint64_t frames;
    /**
     * Frames without a surface.
     */
    uint64_t empty;
    /**
     * Frames that were left out.
     */
    uint64_t skipped;
    /**
     * Size of the stream (bytes).
     */
    uint64_t bytes;
    /**
     * Time that the stream takes to show (ns).
     */
    uint64_t duration_ns;
    /**
     * Mean rate (bits a second); 0 for a stream that takes no time.
     */
    double bits_per_second;
    /**
     * Edge of a voxel (m).
     */
    double voxel_m;
    /**
     * Thickness of the shell around surfaces without inside (m); 0 if none was made.
     */
    double shell_m;
    /**
     * 1 if a callback stopped the job, so that the stream holds the first frames alone; else 0.
     */
    int32_t is_cancelled;
} isv_report;

/**
 * Result of a stream that was decoded to files.
 */
typedef struct isv_decode_report {
    /**
     * Size of this struct: set it to `sizeof(isv_decode_report)`.
     */
    size_t struct_size;
    /**
     * Frames written.
     */
    uint64_t frames;
    /**
     * Largest distance (m) between a mesh with fewer faces and the decoded surface; 0 where no faces were taken away.
     */
    double simplify_error_m;
    /**
     * 1 if a callback stopped the job, so that the first frames alone were written; else 0.
     */
    int32_t is_cancelled;
} isv_decode_report;

/**
 * Takes the next bytes of a stream. Returns 0, or another number for a failure, which ends the stream.
 *
 * It is called on the thread that pushes a frame or finishes the writer. `bytes` is the library's, and good during the call.
 */
typedef int32_t (*isv_write_fn)(void *user, const uint8_t *bytes, size_t size);

/**
 * Lens and place of a camera. Lens distortion has been removed from its images, which have 2^28 pixels at most.
 */
typedef struct isv_camera {
    /**
     * Pixels a row.
     */
    uint32_t width;
    /**
     * Rows.
     */
    uint32_t height;
    /**
     * Focal lengths along x and y (pixels).
     */
    double focal[2];
    /**
     * Column and row of the principal point (pixels).
     */
    double principal[2];
    /**
     * Transform from the camera to the world (m), 4 x 4, row by row. The camera looks along +z, its x points right and its y down.
     */
    double camera_to_world[16];
} isv_camera;

/**
 * Image of a depth camera.
 */
typedef struct isv_depth_image {
    /**
     * Lens and place of the camera.
     */
    struct isv_camera camera;
    /**
     * Depths along z (m), row by row from the top; 0 or NaN where there is no reading. `width` x `height` numbers.
     */
    const float *depths;
} isv_depth_image;

/**
 * Image of a colour camera.
 */
typedef struct isv_colour_image {
    /**
     * Lens and place of the camera.
     */
    struct isv_camera camera;
    /**
     * 8-bit sRGB, row by row from the top: red, green, blue. `width` x `height` x 3 numbers.
     */
    const uint8_t *colours;
    /**
     * Number of the depth image of the same push from about the same place, such as that of an RGB-D camera. It is -1 if there is
     * none.
     */
    int32_t depth_image;
} isv_colour_image;

/**
 * A dense field of signed distances (TSDF): a box of voxels.
 */
typedef struct isv_dense_volume {
    /**
     * Size of this struct: set it to `sizeof(isv_dense_volume)`.
     */
    size_t struct_size;
    /**
     * Edge of a voxel (m).
     */
    double voxel_m;
    /**
     * Distance from the surface at which distances are cut off (voxels). Voxels outside the box are not observed.
     */
    uint32_t truncation_voxels;
    /**
     * Voxels along x, y and z.
     */
    uint32_t size[3];
    /**
     * Place of the first voxel, in voxels: x, y, z. The lowest corner of the box is at place x `voxel_m`.
     */
    int32_t first[3];
    /**
     * Distances at the centres of voxels (m), negative inside, NaN where not observed. x fastest, then y, then z. As many as voxels.
     */
    const float *distances;
} isv_dense_volume;

/**
 * End with an error. The default.
 */
#define ISV_AFTER_LOSS_STOP 0

/**
 * Hold the last frame in place of each lost one, and go on where that can be.
 */
#define ISV_AFTER_LOSS_HOLD 1

/**
 * Least work, for live encoding.
 */
#define ISV_PRESET_REALTIME 0

/**
 * Good for most uses. The default.
 */
#define ISV_PRESET_BALANCED 1

/**
 * Ten times the work of `ISV_PRESET_BALANCED`, for 6 to 11 % fewer bits at equal error.
 */
#define ISV_PRESET_ARCHIVE 2

/**
 * `ISV_SIGN_CLOSED` if all parts of the first frame are closed, else `ISV_SIGN_SHEET`. The default.
 */
#define ISV_SIGN_AUTO 0

/**
 * Closed surfaces, by winding number.
 */
#define ISV_SIGN_CLOSED 1

/**
 * Part by part: closed parts have an inside, open parts are single sheets.
 */
#define ISV_SIGN_SHEET 2

/**
 * A thin closed shell around the surface.
 */
#define ISV_SIGN_SHELL 3

/**
 * Recovery at keyframes. The default.
 */
#define ISV_REFRESH_KEYFRAMES 0

/**
 * Recovery bit by bit. Only the first frame is a keyframe.
 */
#define ISV_REFRESH_GRADUAL 1

/**
 * Times of the capture, or of `isv_writer_push_mesh_at` and the like. Without any, the frame rate. The default.
 */
#define ISV_TIMESTAMPS_SOURCE 0

/**
 * One frame after the other at the frame rate.
 */
#define ISV_TIMESTAMPS_RATE 1

/**
 * The time at which a frame is pushed, in nanoseconds since 1970, for live streams.
 */
#define ISV_TIMESTAMPS_CLOCK 2

/**
 * Metadata where the stream has colour, a title or a capture device. The default.
 */
#define ISV_METADATA_AUTO 0

/**
 * Metadata in any stream. It then has version 2 of the format.
 */
#define ISV_METADATA_ALWAYS 1

/**
 * No metadata.
 */
#define ISV_METADATA_NEVER 2

/**
 * The CPU. The default.
 */
#define ISV_DEVICE_CPU 0

/**
 * A GPU, or an error. The library must have been built with its feature `gpu`.
 */
#define ISV_DEVICE_GPU 1

/**
 * A GPU if there is one that can, else the CPU.
 */
#define ISV_DEVICE_AUTO 2

/**
 * Success.
 */
#define ISV_OK 0

/**
 * Success, and nothing follows: all frames were read.
 */
#define ISV_END 1

/**
 * An argument that cannot be: a null pointer, a wrong size, text that is not UTF-8.
 */
#define ISV_ERROR_ARGUMENT -1

/**
 * A handle that is null, was freed, is of another type, or did not come from this library.
 */
#define ISV_ERROR_HANDLE -2

/**
 * A handle that serves another call at this moment, perhaps the one whose callback this is.
 */
#define ISV_ERROR_BUSY -3

/**
 * A call that comes too late: the writer is finished, or failed before.
 */
#define ISV_ERROR_STATE -4

/**
 * An option, or a combination of options, that cannot be.
 */
#define ISV_ERROR_OPTIONS -5

/**
 * An input that cannot be read, or that holds no frames.
 */
#define ISV_ERROR_INPUT -6

/**
 * One frame that cannot be read or used. Others may be sound.
 */
#define ISV_ERROR_FRAME -7

/**
 * A stream that is damaged, cut, or of a newer version.
 */
#define ISV_ERROR_STREAM -8

/**
 * More memory than is allowed.
 */
#define ISV_ERROR_MEMORY -9

/**
 * A GPU that is not there, or that failed.
 */
#define ISV_ERROR_DEVICE -10

/**
 * An output that cannot be written.
 */
#define ISV_ERROR_OUTPUT -11

/**
 * A job that was cancelled before it had a result.
 */
#define ISV_ERROR_CANCELLED -12

/**
 * A fault of this library. Free the handles of the call.
 */
#define ISV_ERROR_INTERNAL -13

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Creates options with all defaults. Free them with `isv_decode_options_free`.
 */
isv_status isv_decode_options_new(struct isv_decode_options **options);

/**
 * Frees options. Null is no error.
 */
isv_status isv_decode_options_free(struct isv_decode_options *options);

/**
 * Writes fields of signed distances (1) or meshes (0, the default), and no points.
 */
isv_status isv_decode_options_set_fields(struct isv_decode_options *options, int32_t are_wanted);

/**
 * Writes points in place of meshes, so many a frame, at least 1.
 */
isv_status isv_decode_options_set_point_count(struct isv_decode_options *options, size_t points);

/**
 * Writes points in place of meshes, each for a square of the surface with this edge (m).
 */
isv_status isv_decode_options_set_point_spacing(struct isv_decode_options *options, double spacing_m);

/**
 * Sets the format of the files of a folder. Meshes have "ply", "obj", "stl", "glb", "usda" or "usdc", points "ply", "pcd" or
 * "xyz", fields "npy" or "vdb".
 */
isv_status isv_decode_options_set_format(struct isv_decode_options *options,
                                         const char *extension);

/**
 * Writes vertex normals of meshes (1) or not (0) [default: in GLB and USD files alone].
 */
isv_status isv_decode_options_set_normals(struct isv_decode_options *options, int32_t are_wanted);

/**
 * Sets the most faces of each mesh, at least 1.
 */
isv_status isv_decode_options_set_target_faces(struct isv_decode_options *options, size_t faces);

/**
 * Collapses edges as long as the surface stays within this distance (m).
 */
isv_status isv_decode_options_set_simplify(struct isv_decode_options *options, double distance_m);

/**
 * Sets the unit of the output: "m", "dm", "cm", "mm", "in", "ft" or "us-ft" [default: "m"].
 */
isv_status isv_decode_options_set_unit(struct isv_decode_options *options, const char *unit);

/**
 * Sets the axis of the output that points up: "x", "y", "z", "-x", "-y" or "-z" [default: "y"].
 */
isv_status isv_decode_options_set_up(struct isv_decode_options *options, const char *axis);

/**
 * Sets the place of the stream's origin in the output, x, y and z in its unit. `place_xyz` has 3 numbers.
 */
isv_status isv_decode_options_set_origin(struct isv_decode_options *options, const double *place_xyz);

/**
 * Decodes the frames from `first` up to and without `end`, counted from 0.
 */
isv_status isv_decode_options_set_frames(struct isv_decode_options *options, uint64_t first, uint64_t end);

/**
 * Sets the level of detail: 1 for all voxels, 2 for half and 4 for a quarter of the resolution [default: 1].
 */
isv_status isv_decode_options_set_lod(struct isv_decode_options *options, uint32_t divisor);

/**
 * Sets the reaction to damaged or missing packets [default: `ISV_AFTER_LOSS_STOP`].
 */
isv_status isv_decode_options_set_after_loss(struct isv_decode_options *options, isv_after_loss after_loss);

/**
 * Sets the device that does the arithmetic [default: `ISV_DEVICE_CPU`].
 */
isv_status isv_decode_options_set_device(struct isv_decode_options *options, isv_device device);

/**
 * Limits the memory for a frame (bytes). Frames that need more are an error.
 */
isv_status isv_decode_options_set_memory_limit(struct isv_decode_options *options, uint64_t bytes);

/**
 * Sets the callback that takes warnings; null for none. `user` comes back to it as it is.
 */
isv_status isv_decode_options_set_event_callback(struct isv_decode_options *options,
                                                 isv_event_fn callback,
                                                 void *user);

/**
 * Sets the callback that follows a job and may stop it; null for none. `user` comes back to it as it is.
 */
isv_status isv_decode_options_set_progress_callback(struct isv_decode_options *options,
                                                    isv_progress_fn callback,
                                                    void *user);

/**
 * Creates options with all defaults. Free them with `isv_encode_options_free`.
 */
isv_status isv_encode_options_new(struct isv_encode_options **options);

/**
 * Frees options. Null is no error.
 */
isv_status isv_encode_options_free(struct isv_encode_options *options);

/**
 * Sets a constant quality from 0 to 100 [default: 50]. It takes the place of a bit rate and of an error.
 */
isv_status isv_encode_options_set_quality(struct isv_encode_options *options, float quality);

/**
 * Sets a bit rate (bits a second) of geometry and colour. It takes the place of a quality and of an error.
 */
isv_status isv_encode_options_set_bitrate(struct isv_encode_options *options, double bits_per_second);

/**
 * Sets an RMS surface error (m) that every frame stays below. It takes the place of a quality and of a bit rate.
 */
isv_status isv_encode_options_set_max_error(struct isv_encode_options *options,
                                            double error_m);

/**
 * Sets the quality of colour from 0 to 100 [default: 50, or what a bit rate gives].
 */
isv_status isv_encode_options_set_colour_quality(struct isv_encode_options *options, float quality);

/**
 * Keeps colour (1, the default) or leaves it out (0).
 */
isv_status isv_encode_options_set_colour(struct isv_encode_options *options, int32_t is_kept);

/**
 * Sets the edge of a voxel (m). By default meshes get 0.005, volumes keep theirs, and points and depth images get what their
 * spacing and noise allow.
 */
isv_status isv_encode_options_set_voxel(struct isv_encode_options *options,
                                        double edge_m);

/**
 * Chooses the voxel size that serves the target best, by coding samples. For `isv_encode_take` with meshes alone.
 */
isv_status isv_encode_options_set_voxel_by_trial(struct isv_encode_options *options);

/**
 * Sets the frames a second, to a thousandth [default: those of the capture, else 30].
 */
isv_status isv_encode_options_set_fps(struct isv_encode_options *options, double fps);

/**
 * Sets the amount of work for small streams [default: `ISV_PRESET_BALANCED`].
 */
isv_status isv_encode_options_set_preset(struct isv_encode_options *options, isv_preset preset);

/**
 * Sets the most frames from a keyframe to the next, at least 1 [default: 30].
 */
isv_status isv_encode_options_set_keyframe_interval(struct isv_encode_options *options, uint32_t frames);

/**
 * Sets the recovery of decoders from lost packets [default: `ISV_REFRESH_KEYFRAMES`].
 */
isv_status isv_encode_options_set_refresh(struct isv_encode_options *options, isv_refresh refresh);

/**
 * Sets the rule that tells inside from outside of meshes and points [default: `ISV_SIGN_AUTO`].
 */
isv_status isv_encode_options_set_sign(struct isv_encode_options *options, isv_sign sign);

/**
 * Estimates the normals of points (1), or takes those that come with them (0, the default).
 */
isv_status isv_encode_options_set_estimated_normals(struct isv_encode_options *options,
                                                    int32_t are_estimated);

/**
 * Takes a frame of depth images for all that was seen so far (1), or for itself alone (0, the default).
 */
isv_status isv_encode_options_set_accumulated_depth(struct isv_encode_options *options,
                                                    int32_t is_accumulated);

/**
 * Leaves out what depth cameras saw farther away (m).
 */
isv_status isv_encode_options_set_max_depth(struct isv_encode_options *options, double depth_m);

/**
 * Sets the source of the frames' times [default: `ISV_TIMESTAMPS_SOURCE`].
 */
isv_status isv_encode_options_set_timestamps(struct isv_encode_options *options, isv_timestamps source);

/**
 * Puts a hash of each decoded frame into the stream (1), or not (0, the default).
 */
isv_status isv_encode_options_set_checksums(struct isv_encode_options *options, int32_t are_wanted);

/**
 * Meets a bit rate by coding the take more than once (1), or once (0, the default). For `isv_encode_take` alone.
 */
isv_status isv_encode_options_set_two_passes(struct isv_encode_options *options,
                                             int32_t are_wanted);

/**
 * Sets the animation of a glTF file, by name or number from 0 [default: the first that moves anything].
 */
isv_status isv_encode_options_set_animation(struct isv_encode_options *options, const char *animation);

/**
 * Sets the title of the take, for people. `isv_info_json` tells it under "metadata".
 */
isv_status isv_encode_options_set_title(struct isv_encode_options *options, const char *title);

/**
 * Sets the name of the device that captured the take, for people.
 */
isv_status isv_encode_options_set_capture_device(struct isv_encode_options *options, const char *device);

/**
 * Sets whether the stream says what it is and how it was made [default: `ISV_METADATA_AUTO`].
 */
isv_status isv_encode_options_set_metadata(struct isv_encode_options *options, isv_metadata choice);

/**
 * Sets the unit of coordinates in files: "m", "dm", "cm", "mm", "in", "ft" or "us-ft" [default: "m"]. For `isv_encode_take` alone.
 */
isv_status isv_encode_options_set_unit(struct isv_encode_options *options,
                                       const char *unit);

/**
 * Sets the axis of files that points up: "x", "y", "z", "-x", "-y" or "-z" [default: "y"]. For `isv_encode_take` alone.
 */
isv_status isv_encode_options_set_up(struct isv_encode_options *options,
                                     const char *axis);

/**
 * Sets the place of meshes and points, x, y and z in their unit, that becomes the origin. `place_xyz` has 3 numbers.
 */
isv_status isv_encode_options_set_origin(struct isv_encode_options *options,
                                         const double *place_xyz);

/**
 * Encodes the frames from `first` up to and without `end`, counted from 0. For `isv_encode_take` alone.
 */
isv_status isv_encode_options_set_frames(struct isv_encode_options *options, uint64_t first, uint64_t end);

/**
 * Leaves out frames that cannot be read or used (1), or stops at them (0, the default). For `isv_encode_take` alone.
 */
isv_status isv_encode_options_set_skip_bad_frames(struct isv_encode_options *options,
                                                  int32_t are_skipped);

/**
 * Sets the device that does the arithmetic [default: `ISV_DEVICE_CPU`]. It is opened when a writer or job begins.
 */
isv_status isv_encode_options_set_device(struct isv_encode_options *options,
                                         isv_device device);

/**
 * Limits the memory for a frame (bytes) that decoders are known to have. Frames that need more are refused.
 */
isv_status isv_encode_options_set_memory_limit(struct isv_encode_options *options, uint64_t bytes);

/**
 * Sets the callback that takes decisions and warnings; null for none. `user` comes back to it as it is.
 *
 * Writers and jobs keep both: they must stay good until these are freed.
 */
isv_status isv_encode_options_set_event_callback(struct isv_encode_options *options,
                                                 isv_event_fn callback,
                                                 void *user);

/**
 * Sets the callback that follows a job and may stop it; null for none. `user` comes back to it as it is. For `isv_encode_take` alone.
 */
isv_status isv_encode_options_set_progress_callback(struct isv_encode_options *options,
                                                    isv_progress_fn callback,
                                                    void *user);

/**
 * Frees a frame, with all arrays that it gave. Null is no error.
 */
isv_status isv_frame_free(struct isv_frame *frame);

/**
 * Tells facts of a frame. `info` is the caller's.
 */
isv_status isv_frame_get_info(const struct isv_frame *frame, struct isv_frame_info *info);

/**
 * Gives the surface as a mesh, with normals, and with colours if the stream has any. `mesh` is the caller's, its arrays are the
 * frame's. A frame without a surface has no vertices, and null pointers.
 */
isv_status isv_frame_get_mesh(const struct isv_frame *frame,
                              struct isv_mesh *mesh);

/**
 * Spreads points evenly over the surface, with normals, and with colours if the stream has any. `points` is the caller's, its arrays
 * are the frame's.
 *
 * `count` is their number; 0 for one a square of the surface with an edge of a voxel. At most 100 million.
 */
isv_status isv_frame_get_points(const struct isv_frame *frame,
                                size_t count,
                                struct isv_points *points);

/**
 * Gives the field of signed distances. `volume` is the caller's, its arrays are the frame's.
 */
isv_status isv_frame_get_volume(const struct isv_frame *frame, struct isv_volume *volume);

/**
 * Returns the number of handles that were not freed yet, of all types. Tests can check that it is 0 at the end.
 */
size_t isv_live_handles(void);

/**
 * Opens a stream in a file. `path` is UTF-8. Free the reader with `isv_reader_free`.
 */
isv_status isv_reader_open(const char *path, struct isv_reader **reader);

/**
 * Opens a stream in memory: `size` bytes, which are copied. Free the reader with `isv_reader_free`.
 */
isv_status isv_reader_open_memory(const uint8_t *bytes, size_t size, struct isv_reader **reader);

/**
 * Opens a stream whose bytes callbacks give. Free the reader with `isv_reader_free`.
 *
 * The struct is copied. Callbacks and their pointer must stay good until the reader is freed. Without a seek callback no byte is read
 * before the first frame is.
 */
isv_status isv_reader_open_source(const struct isv_source *source,
                                  struct isv_reader **reader);

/**
 * Frees a reader. Null is no error. Frames that it gave stay good.
 */
isv_status isv_reader_free(struct isv_reader *reader);

/**
 * Tells facts of a stream. `info` is the caller's.
 */
isv_status isv_reader_info(struct isv_reader *reader, struct isv_stream_info *info);

/**
 * Sets the level of detail: 1 for all voxels, 2 for half and 4 for a quarter of the resolution [default: 1].
 *
 * Frames from the next one on have it. Where the source can seek, it may be set between any two frames.
 */
isv_status isv_reader_set_lod(struct isv_reader *reader, uint32_t divisor);

/**
 * Sets the reaction to damaged or missing packets [default: `ISV_AFTER_LOSS_STOP`]. See `isv_reader_set_lod` for when.
 */
isv_status isv_reader_set_after_loss(struct isv_reader *reader,
                                     isv_after_loss after_loss);

/**
 * Leaves colour out from the next frame on, which saves the time to decode it. See `isv_reader_set_lod` for when.
 */
isv_status isv_reader_leave_out_colour(struct isv_reader *reader);

/**
 * Sets the device that does the arithmetic [default: `ISV_DEVICE_CPU`]. See `isv_reader_set_lod` for when.
 */
isv_status isv_reader_set_device(struct isv_reader *reader, isv_device device);

/**
 * Limits the memory for a frame (bytes). Without a limit a frame has 3 billion voxels at most, and no more than the stream's bytes make
 * likely. See `isv_reader_set_lod` for when.
 */
isv_status isv_reader_set_memory_limit(struct isv_reader *reader,
                                       uint64_t bytes);

/**
 * Sets the callback that takes warnings, such as damage that was met. See `isv_reader_set_lod` for when.
 *
 * It and `user` must stay good until the reader is freed.
 */
isv_status isv_reader_set_event_callback(struct isv_reader *reader, isv_event_fn callback, void *user);

/**
 * Goes to a frame, counted from 0: the next one that is read. Frames since the keyframe before it are decoded on the way.
 *
 * Frame 0 is the start of any stream, though there may be no frame.
 */
isv_status isv_reader_seek(struct isv_reader *reader,
                           uint64_t frame);

/**
 * Decodes the next frame. Returns `ISV_END` and a null frame behind the last one. Free the frame with `isv_frame_free`.
 */
isv_status isv_reader_next_frame(struct isv_reader *reader,
                                 struct isv_frame **frame);

/**
 * Returns the words for the last error of the calling thread: one sentence in UTF-8, empty if there was none.
 *
 * The library owns the text. It is good until the next call of this thread that returns an error.
 */
const char *isv_error_message(void);

/**
 * Returns the name of a result, such as "ISV_ERROR_FRAME", or "unknown". The library owns the text, for good.
 */
const char *isv_status_name(isv_status status);

/**
 * Encodes a capture into a stream.
 *
 * `input` is a folder of frames, a pattern such as `take_*.obj`, one file, or an `.isv` file. `output` is the stream's path. Both are
 * UTF-8. `options` and `report` may be null. The output has its name once it is whole, and a file that is there is replaced then.
 *
 * A job that the progress callback stops returns `ISV_OK` and a shorter stream, or `ISV_ERROR_CANCELLED` and none.
 */
isv_status isv_encode_take(const char *input,
                           const char *output,
                           const struct isv_encode_options *options,
                           struct isv_report *report);

/**
 * Decodes a stream to files.
 *
 * `input` is the stream's path. `output` is a folder, which gets `frame_0000.ply` and so on, a file of one frame, or a `.glb`, `.usdc`
 * or `.usda` file of all. Both are UTF-8. `options` and `report` may be null. Files that isv did not write are not replaced.
 */
isv_status isv_decode_take(const char *input,
                           const char *output,
                           const struct isv_decode_options *options,
                           struct isv_decode_report *report);

/**
 * Copies frames `first` to `end - 1` of a stream, from a keyframe on. Nothing is coded anew. `end` may be `UINT64_MAX` for all.
 *
 * `input` and `output` are paths in UTF-8. An output that is named `.mp4` is an MP4 file. `frames` gets the number of frames, and may be
 * null. The output has its name once it is whole.
 */
isv_status isv_cut(const char *input,
                   uint64_t first,
                   uint64_t end,
                   const char *output,
                   uint64_t *frames);

/**
 * Puts streams one after the other. Nothing is coded anew. They have the same profile, grid, frame rate, layers of colour and version.
 *
 * `inputs` has `input_count` paths, at least one. See `isv_cut` on paths, `output` and `frames`.
 */
isv_status isv_join(const char *const *inputs,
                    size_t input_count,
                    const char *output,
                    uint64_t *frames);

/**
 * Makes a stream of what is sound in a damaged, cut or unfinished one. Packets are kept byte for byte.
 *
 * `header_from` is a stream of the same take, whose header stands for a damaged one; it may be null. `frames` gets the number of frames
 * that are kept. See `isv_cut` on paths, `output` and `frames`.
 */
isv_status isv_repair(const char *input,
                      const char *header_from,
                      const char *output,
                      uint64_t *frames);

/**
 * Puts a stream into an MP4 file, with sound beside it. Nothing is coded anew but waveforms, which become Opus.
 *
 * `sound` is the path of an MP4, MP3, Ogg, FLAC or WAV file; it may be null. See `isv_cut` on paths, `output` and `frames`.
 */
isv_status isv_mux(const char *input,
                   const char *sound,
                   const char *output,
                   uint64_t *frames);

/**
 * Takes the stream out of an MP4 file, byte for byte. See `isv_cut` on paths and `output`.
 */
isv_status isv_demux(const char *input, const char *output);

/**
 * Measures a capture or a stream against a reference, frame by frame, as JSON: what `isv eval --json` prints. Both are what
 * `isv_encode_take` takes, in metres and Y up.
 *
 * Surfaces are sampled about every `spacing_m` (m). Free the text with `isv_text_free`.
 */
isv_status isv_evaluate_json(const char *reference,
                             const char *test,
                             double spacing_m,
                             const char **json);

/**
 * Describes a stream in a file, frame by frame, as JSON: what `isv info --json` prints. `path` is UTF-8.
 *
 * Free the text with `isv_text_free`.
 */
isv_status isv_info_json(const char *path, const char **json);

/**
 * Frees a text of `isv_info_json` or `isv_evaluate_json`. Null is no error.
 */
isv_status isv_text_free(const char *text);

/**
 * Sets the number of threads that share the arithmetic of all handles, from 1 to 1024. The default is one a processor, or what the
 * environment variable `RAYON_NUM_THREADS` says.
 *
 * It must come before the first frame is coded: the threads start then, and stay until the process ends. Later it is
 * `ISV_ERROR_STATE`.
 */
isv_status isv_set_thread_count(uint32_t threads);

/**
 * Returns the version of the library that the program runs with: major * 65536 + minor * 256 + patch.
 */
uint32_t isv_version(void);

/**
 * Returns the version of the library as text, such as "0.1.0". The library owns the text, for good.
 */
const char *isv_version_text(void);

/**
 * Creates a writer to a file. `path` is UTF-8. `options` may be null for the defaults, and may be freed at once.
 *
 * The file has its name once `isv_writer_finish` was called. Until then it is called `path` with `.part` behind it. Free the writer with
 * `isv_writer_free`.
 */
isv_status isv_writer_create(const char *path,
                             const struct isv_encode_options *options,
                             struct isv_writer **writer);

/**
 * Creates a writer to a callback. `options` may be null for the defaults, and may be freed at once.
 *
 * The callback is called by the calls that push frames, and by `isv_writer_finish`. It and `user` must stay good until the writer is
 * freed. Bytes come in order, and the stream can be sent while it is made. Free the writer with `isv_writer_free`.
 */
isv_status isv_writer_create_callback(isv_write_fn callback,
                                      void *user,
                                      const struct isv_encode_options *options,
                                      struct isv_writer **writer);

/**
 * Frees a writer. Null is no error. A writer to a file that is not finished leaves no file.
 */
isv_status isv_writer_free(struct isv_writer *writer);

/**
 * Encodes a mesh. One without triangles is a frame without a surface.
 */
isv_status isv_writer_push_mesh(struct isv_writer *writer, const struct isv_mesh *mesh);

/**
 * Encodes a mesh that was taken at a time (ns), from any start. Later frames have later times.
 */
isv_status isv_writer_push_mesh_at(struct isv_writer *writer, const struct isv_mesh *mesh, uint64_t time_ns);

/**
 * Encodes points. None at all are a frame without a surface.
 *
 * Without normals a thin shell is made around them, unless `isv_encode_options_set_estimated_normals` asks for estimates.
 */
isv_status isv_writer_push_points(struct isv_writer *writer,
                                  const struct isv_points *points);

/**
 * Encodes points that were taken at a time (ns), from any start. Later frames have later times.
 */
isv_status isv_writer_push_points_at(struct isv_writer *writer,
                                     const struct isv_points *points,
                                     uint64_t time_ns);

/**
 * Encodes what depth cameras, and perhaps colour cameras, saw at one instant.
 *
 * `depth_images` has `depth_count` images, at least 1. `colour_images` has `colour_count` images, and is null for none. A stream has
 * colour if its first frame has.
 */
isv_status isv_writer_push_depth(struct isv_writer *writer,
                                 const struct isv_depth_image *depth_images,
                                 size_t depth_count,
                                 const struct isv_colour_image *colour_images,
                                 size_t colour_count);

/**
 * Encodes what cameras saw at a time (ns), from any start. Later frames have later times. See `isv_writer_push_depth`.
 */
isv_status isv_writer_push_depth_at(struct isv_writer *writer,
                                    const struct isv_depth_image *depth_images,
                                    size_t depth_count,
                                    const struct isv_colour_image *colour_images,
                                    size_t colour_count,
                                    uint64_t time_ns);

/**
 * Encodes a sparse field of signed distances.
 */
isv_status isv_writer_push_volume(struct isv_writer *writer, const struct isv_volume *volume);

/**
 * Encodes a sparse field of signed distances of a time (ns), from any start. Later frames have later times.
 */
isv_status isv_writer_push_volume_at(struct isv_writer *writer,
                                     const struct isv_volume *volume,
                                     uint64_t time_ns);

/**
 * Encodes a dense field of signed distances. Parts of it that are not observed, or far outside, cost nothing.
 */
isv_status isv_writer_push_dense_volume(struct isv_writer *writer, const struct isv_dense_volume *volume);

/**
 * Encodes a dense field of signed distances of a time (ns), from any start. Later frames have later times.
 */
isv_status isv_writer_push_dense_volume_at(struct isv_writer *writer,
                                           const struct isv_dense_volume *volume,
                                           uint64_t time_ns);

/**
 * Completes the stream, and gives a file its name. `report` may be null. Afterwards only `isv_writer_free` may follow.
 */
isv_status isv_writer_finish(struct isv_writer *writer,
                             struct isv_report *report);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ISV_H */
