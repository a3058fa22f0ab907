// Tests of the core of the package without Unity: Program.exe BALL.isv, a stream of encode_meshes.c.
using System;
using System.Collections.Generic;
using System.IO;
using System.Threading;
using Isv;

internal static class Program
{
    private static int Main(string[] arguments)
    {
        string path = arguments[0];
        FramesAreDecoded(path);
        SeekingGivesTheSameFrames(path);
        BytesAreAStreamToo(path);
        ErrorsHaveWords(path);
        FramesAreShownByTheClock(path);
        TheFirstFrameFollowsTheLast(path);
        DamageIsThrownOnce(path);
        PlaybackStopsWhileItDecodes(path);
        Require(Reader.LiveHandles == 0, "all handles are freed");
        Console.WriteLine("C#: 8 tests of the Unity package's core");
        return 0;
    }

    private static void Require(bool isTrue, string what)
    {
        if (!isTrue)
        {
            throw new Exception("not true: " + what);
        }
    }

    private static void FramesAreDecoded(string path)
    {
        using (Reader reader = Reader.Open(path))
        {
            Require(reader.FrameCount > 2 && reader.Fps == 30 && reader.HasColour, "the facts of the stream");
            FrameArrays frame = new FrameArrays();
            long count = 0;
            while (reader.Next(frame))
            {
                Require(frame.Number == count && Math.Abs(frame.Seconds - count / 30.0) < 1e-6, "number and time");
                count++;
                CheckBall(frame);
            }
            Require(count == reader.FrameCount, "all frames come");
        }
    }

    // The ball has a radius of 25 cm, its middle above the origin, and faces and normals that point outside in left-handed axes.
    private static void CheckBall(FrameArrays frame)
    {
        Require(frame.VertexCount > 1000 && frame.IndexCount > 3000 && frame.IndexCount % 3 == 0, "there is a mesh");
        for (int axis = 0; axis < 3; axis++)
        {
            Require(Math.Abs(frame.High[axis] - frame.Low[axis] - 0.5) < 0.02, "its extent");
        }
        float middle = (frame.Low[1] + frame.High[1]) / 2;
        for (int v = 0; v < frame.VertexCount; v++)
        {
            float x = frame.Positions[3 * v], y = frame.Positions[3 * v + 1] - middle, z = frame.Positions[3 * v + 2];
            float outwards = x * frame.Normals[3 * v] + y * frame.Normals[3 * v + 1] + z * frame.Normals[3 * v + 2];
            Require(outwards > 0.2 && outwards < 0.3, "normals point outside");
            Require(frame.Colours[4 * v + 3] == 255, "colours are opaque");
        }
        for (int i = 0; i < frame.IndexCount; i += 3)
        {
            int a = 3 * frame.Indices[i], b = 3 * frame.Indices[i + 1], c = 3 * frame.Indices[i + 2];
            float[] p = frame.Positions;
            double ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
            double vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
            // Seen from outside, corners go round clockwise in left-handed axes: by the right hand rule the product points outside too.
            double outwards = (uy * vz - uz * vy) * p[a] + (uz * vx - ux * vz) * (p[a + 1] - middle) + (ux * vy - uy * vx) * p[a + 2];
            Require(outwards > -1e-12, "triangles face outside");
        }
    }

    private static List<float[]> AllPositions(Reader reader)
    {
        List<float[]> all = new List<float[]>();
        FrameArrays frame = new FrameArrays();
        while (reader.Next(frame))
        {
            float[] positions = new float[3 * frame.VertexCount];
            Array.Copy(frame.Positions, positions, positions.Length);
            all.Add(positions);
        }
        return all;
    }

    private static bool Same(float[] expected, FrameArrays found)
    {
        if (3 * found.VertexCount != expected.Length)
        {
            return false;
        }
        for (int i = 0; i < expected.Length; i++)
        {
            if (expected[i] != found.Positions[i])
            {
                return false;
            }
        }
        return true;
    }

    private static void SeekingGivesTheSameFrames(string path)
    {
        using (Reader reader = Reader.Open(path))
        {
            List<float[]> all = AllPositions(reader);
            FrameArrays frame = new FrameArrays();
            foreach (int number in new int[] { 2, 0, all.Count - 1, 1 })
            {
                reader.Seek(number);
                Require(reader.Next(frame) && frame.Number == number && Same(all[number], frame), "frame " + number);
            }
            reader.SetLevelOfDetail(2);
            reader.LeaveOutColour();
            Require(reader.Next(frame) && frame.Number == 2 && frame.IndexCount * 2 < all[2].Length * 2, "fewer triangles");
            Require(frame.Colours[0] == 255 && frame.Colours[1] == 255, "white without colour");
        }
    }

    private static void BytesAreAStreamToo(string path)
    {
        using (Reader file = Reader.Open(path))
        using (Reader memory = Reader.FromBytes(File.ReadAllBytes(path)))
        {
            FrameArrays frame = new FrameArrays();
            foreach (float[] positions in AllPositions(file))
            {
                Require(memory.Next(frame) && Same(positions, frame), "the same from memory");
            }
        }
    }

    private static int StatusOf(Action action)
    {
        try
        {
            action();
        }
        catch (IsvException error)
        {
            Require(error.Message.Length > 5, "an error has words");
            return error.Status;
        }
        return 0;
    }

    private static void ErrorsHaveWords(string path)
    {
        Require(StatusOf(() => Reader.Open("no/such/file.isv")) == -6, "a file that is not there");
        Require(StatusOf(() => Reader.FromBytes(new byte[100])) == -8, "bytes that are no stream");
        using (Reader reader = Reader.Open(path))
        {
            Require(StatusOf(() => reader.Seek(-1)) == -5, "a frame that is not there");
            Require(StatusOf(() => reader.SetLevelOfDetail(3)) == -5, "a level that is not there");
        }
        Reader closed = Reader.Open(path);
        closed.Dispose();
        closed.Dispose();
        bool isRefused = false;
        try
        {
            closed.Next(new FrameArrays());
        }
        catch (ObjectDisposedException)
        {
            isRefused = true;
        }
        Require(isRefused, "a disposed reader is refused");
    }

    // Waits for a frame at a time.
    private static FrameArrays Await(Playback playback, double seconds)
    {
        for (int tries = 0; tries < 6000; tries++)
        {
            FrameArrays frame = playback.Take(seconds);
            if (frame != null)
            {
                return frame;
            }
            Thread.Sleep(10);
        }
        throw new Exception("no frame comes");
    }

    private static void FramesAreShownByTheClock(string path)
    {
        using (Playback playback = new Playback(Reader.Open(path), false, 3))
        {
            Require(Await(playback, 0).Number == 0, "the first frame comes first");
            Thread.Sleep(200);
            Require(playback.Take(0.02) == null, "frame 1 is not due yet");
            Require(Await(playback, 0.034).Number == 1, "frame 1 is due");
            long last = 1;
            while (!playback.HasEnded)
            {
                FrameArrays frame = playback.Take(1e9);
                if (frame != null)
                {
                    Require(frame.Number > last, "numbers ascend");
                    last = frame.Number;
                }
                Thread.Sleep(5);
            }
            Require(last > 2 && playback.Take(1e9) == null, "nothing follows the end");
        }
    }

    private static void TheFirstFrameFollowsTheLast(string path)
    {
        long count;
        using (Reader reader = Reader.Open(path))
        {
            count = reader.FrameCount;
        }
        using (Playback playback = new Playback(Reader.Open(path), true, 2))
        {
            for (long number = 0; number < 2 * count + 1; number++)
            {
                FrameArrays frame = Await(playback, (number + 0.01) / 30);
                Require(frame.Number == number % count, "frame " + number + " of a loop");
                Require(!playback.HasEnded, "a loop has no end");
            }
        }
    }

    private static void DamageIsThrownOnce(string path)
    {
        byte[] bytes = File.ReadAllBytes(path);
        bytes[bytes.Length / 2] ^= 0x55;
        Reader reader = Reader.FromBytes(bytes);
        using (Playback playback = new Playback(reader, true, 2))
        {
            int status = 0;
            for (int tries = 0; tries < 6000 && status == 0; tries++)
            {
                status = StatusOf(() => playback.Take(1e9));
                Thread.Sleep(2);
            }
            Require(status == -8, "damage is told");
            Require(playback.Take(1e9) == null && playback.HasEnded, "and nothing follows");
        }
    }

    private static void PlaybackStopsWhileItDecodes(string path)
    {
        for (int i = 0; i < 3; i++)
        {
            new Playback(Reader.Open(path), true, 1).Dispose();
        }
    }
}
