"""Tests of the add-on, run by Blender: `blender --background --factory-startup --python inside_blender.py -- FOLDER`.

FOLDER gets the files that are made, among them `frame.png`, a rendered picture. The exit status is 1 if anything fails.
"""

import math
import os
import sys
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
FOLDER = sys.argv[sys.argv.index("--") + 1]
sys.path.insert(0, os.path.dirname(HERE))

import bpy  # noqa: E402
import isv  # noqa: E402
import isv_blender  # noqa: E402
import numpy as np  # noqa: E402
from isv_blender import timing  # noqa: E402


def balls(frames=6, voxel=0.02):
    """A ball that moves along x by 5 cm a frame, red on the left and blue on the right."""
    count = 48
    u, v = np.meshgrid(np.arange(count), np.arange(count // 2 + 1), indexing="ij")
    around, down = 2 * np.pi * u / count, np.pi * v / (count // 2)
    directions = np.stack([np.cos(around) * np.sin(down), np.cos(down), np.sin(around) * np.sin(down)], -1)
    number = np.arange(count * (count // 2 + 1)).reshape(count, -1)
    right = np.roll(number, -1, axis=0)
    quads = np.stack([number[:, :-1], right[:, :-1], right[:, 1:], number[:, 1:]], -1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
    colours = np.where(directions[..., :1] < 0, [200, 30, 20], [20, 30, 200]).reshape(-1, 3).astype(np.uint8)
    for frame in range(frames):
        yield (0.3 * directions + [0.05 * frame, 0.5, 0.0]).reshape(-1, 3), faces, colours


def centre(target):
    """The middle of an object's vertices."""
    positions = np.empty(3 * len(target.data.vertices), np.float32)
    target.data.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3).mean(axis=0)


class AddOn(unittest.TestCase):
    """Each test begins with an empty file."""

    @classmethod
    def setUpClass(cls):
        cls.stream = os.path.join(FOLDER, "balls.isv")
        isv.encode(balls(), cls.stream, voxel=0.02, fps=25)

    def setUp(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        isv_blender.register()

    def tearDown(self):
        isv_blender.unregister()

    def imported(self):
        self.assertEqual(bpy.ops.import_scene.isv(filepath=self.stream), {"FINISHED"})
        return bpy.context.object

    def test_an_object_follows_the_timeline_in_any_order(self):
        ball = self.imported()
        scene = bpy.context.scene
        self.assertEqual((scene.render.fps / scene.render.fps_base, scene.frame_end), (25, 6))
        for frame in [1, 5, 2, 6, 6, 1, 3]:
            scene.frame_set(frame)
            # Y up became Z up.
            np.testing.assert_allclose(centre(ball), [0.05 * (frame - 1), 0, 0.5], atol=0.01)
        mesh = ball.data
        self.assertFalse(mesh.validate(verbose=True))
        self.assertTrue(all(polygon.loop_total == 3 for polygon in mesh.polygons))

    def test_the_mesh_and_its_colours_are_those_of_the_package(self):
        ball = self.imported()
        bpy.context.scene.frame_set(4)
        with isv.open(self.stream) as take:
            surface = take[3].mesh()
        values = np.empty(4 * len(surface.vertices), np.float32)
        ball.data.color_attributes["Col"].data.foreach_get("color_srgb", values)
        np.testing.assert_array_equal(np.rint(255 * values.reshape(-1, 4)[:, :3]), surface.colors)
        corners = np.empty(3 * len(surface.faces), np.int32)
        ball.data.loops.foreach_get("vertex_index", corners)
        np.testing.assert_array_equal(corners.reshape(-1, 3), surface.faces)
        self.assertEqual([material.name for material in ball.data.materials], ["isv colour"])

    def test_faces_look_outward(self):
        ball = self.imported()
        for polygon in list(ball.data.polygons)[::50]:
            away = np.array(polygon.center) - [0, 0, 0.5]
            self.assertGreater(np.dot(away, polygon.normal), 0)

    def test_a_part_plays_backward_and_loops(self):
        ball = self.imported()
        ball.isv.first, ball.isv.last, ball.isv.reverse, ball.isv.extend = 2, 4, True, "LOOP"
        places = []
        for frame in range(1, 8):
            bpy.context.scene.frame_set(frame)
            places.append(round(centre(ball)[0] / 0.05))
        self.assertEqual(places, [4, 3, 2, 4, 3, 2, 4])
        ball.isv.extend = "HIDE"
        self.assertEqual(len(ball.data.vertices), 0)

    def test_what_is_missing_is_said_in_the_panel(self):
        ball = self.imported()
        ball.isv.path = "/nowhere/none.isv"
        self.assertIn("none.isv", ball.isv.problem)
        ball.isv.path = self.stream
        self.assertEqual(ball.isv.problem, "")
        with self.assertRaisesRegex(RuntimeError, "none.isv"):
            bpy.ops.import_scene.isv(filepath="/nowhere/none.isv")
        self.assertEqual(len(bpy.data.objects), 1)

    def test_a_saved_file_plays_when_it_is_loaded(self):
        self.imported()
        path = os.path.join(FOLDER, "saved.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        ball = bpy.data.objects["balls"]
        bpy.context.scene.frame_set(6)
        np.testing.assert_allclose(centre(ball), [0.25, 0, 0.5], atol=0.01)

    def test_an_animated_mesh_comes_back(self):
        bpy.ops.mesh.primitive_cube_add(size=0.5)
        cube = bpy.context.object
        colours = cube.data.color_attributes.new("paint", "BYTE_COLOR", "CORNER")
        colours.data.foreach_set("color_srgb", [0.2, 0.6, 0.4, 1.0] * len(colours.data))
        scene = bpy.context.scene
        scene.frame_start, scene.frame_end = 1, 4
        for frame, z in [(1, 0.0), (4, 0.3)]:
            cube.location = (0.1, 0.2, z)
            cube.keyframe_insert("location", frame=frame)
        for curve in cube.animation_data.action.fcurves:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
        path = os.path.join(FOLDER, "cube.isv")
        self.assertEqual(bpy.ops.export_scene.isv(filepath=path, voxel=0.02), {"FINISHED"})
        with isv.open(path) as take:
            self.assertEqual((len(take), take.fps), (4, 24))
            for number, frame in enumerate(take):
                mesh = frame.mesh()
                middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
                np.testing.assert_allclose(middle, [0.1, 0.1 * number, -0.2], atol=0.01)
                np.testing.assert_allclose(np.median(mesh.colors, axis=0), [51, 153, 102], atol=3)
        self.assertEqual(scene.frame_current, 1)

    def test_nothing_selected_is_an_error(self):
        with self.assertRaisesRegex(RuntimeError, "select the meshes"):
            bpy.ops.export_scene.isv(filepath=os.path.join(FOLDER, "none.isv"))
        self.assertFalse(os.path.exists(os.path.join(FOLDER, "none.isv")))

    def test_a_frame_is_rendered_in_colour(self):
        self.imported()
        scene = bpy.context.scene
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        camera.location, camera.rotation_euler = (0.25, -2.5, 0.5), (math.pi / 2, 0, 0)
        scene.collection.objects.link(camera)
        sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
        sun.data.energy, sun.rotation_euler = 3.0, (math.pi / 3, 0, 0)
        scene.collection.objects.link(sun)
        scene.camera = camera
        scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 8, False
        scene.render.resolution_x, scene.render.resolution_y = 320, 240
        scene.view_settings.view_transform = "Standard"
        scene.frame_set(6)
        scene.render.filepath = os.path.join(FOLDER, "frame.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.array(image.pixels[:]).reshape(240, 320, 4)[:, :, :3]
        red = (pixels[..., 0] > 2 * pixels[..., 2]) & (pixels[..., 0] > 0.2)
        blue = (pixels[..., 2] > 2 * pixels[..., 0]) & (pixels[..., 2] > 0.2)
        self.assertGreater(red.sum(), 500)
        self.assertGreater(blue.sum(), 500)
        # The ball has moved to the middle of the picture, red on the left.
        self.assertLess(np.argwhere(red)[:, 1].mean(), 160)
        self.assertGreater(np.argwhere(blue)[:, 1].mean(), 160)


class Timing(unittest.TestCase):
    """Frames of a scene and of a take."""

    def test_rates_and_speeds_are_kept(self):
        at = [timing.shown(frame, 24, 30, last=99) for frame in range(1, 26)]
        self.assertEqual((at[0], at[4], at[24]), (0, 5, 30))
        self.assertEqual(timing.shown(25, 24, 30, last=99, speed=0.5), 15)

    def test_frames_that_meet_are_not_missed_by_rounding(self):
        for fps in [23.976, 29.97, 30.0, 59.94]:
            found = [timing.shown(frame, fps, fps, last=10_000) for frame in range(1, 2000)]
            self.assertEqual(found, list(range(1999)))


if __name__ == "__main__":
    result = unittest.main(argv=["inside_blender"], exit=False).result
    # Blender's own exit status does not tell.
    sys.stdout.flush()
    os._exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
