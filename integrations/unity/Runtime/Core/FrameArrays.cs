using System;
using System.Runtime.InteropServices;

namespace Isv
{
    /// <summary>A decoded frame in arrays, which grow as needed and are used again.</summary>
    /// <remarks>
    /// Axes are Unity's: left-handed, Y up, metres. The stream's x is negated, and two corners of each triangle are swapped.
    /// Arrays may be longer than what they hold.
    /// </remarks>
    public sealed class FrameArrays
    {
        /// <summary>Number in the stream, from 0.</summary>
        public long Number { get; internal set; }

        /// <summary>Time at which it is shown (s), from the stream's start.</summary>
        public double Seconds { get; internal set; }

        /// <summary>Number of vertices.</summary>
        public int VertexCount { get; private set; }

        /// <summary>Number of indices: three a triangle.</summary>
        public int IndexCount { get; private set; }

        /// <summary>Positions (m): x, y, z.</summary>
        public float[] Positions = new float[0];

        /// <summary>Unit normals: x, y, z.</summary>
        public float[] Normals = new float[0];

        /// <summary>8-bit sRGB colours: red, green, blue, and 255. White for streams without colour.</summary>
        public byte[] Colours = new byte[0];

        /// <summary>Vertices of the triangles, clockwise seen from outside.</summary>
        public int[] Indices = new int[0];

        private byte[] packed = new byte[0];

        /// <summary>Lowest corner (m): x, y, z; all 0 without vertices.</summary>
        public readonly float[] Low = new float[3];

        /// <summary>Highest corner (m): x, y, z; all 0 without vertices.</summary>
        public readonly float[] High = new float[3];

        internal void Copy(Native.Mesh mesh)
        {
            // .NET's arrays have at most 2 GB: more is an OverflowException here, not a wrong count.
            int vertices = checked((int)mesh.VertexCount);
            int triangles = checked((int)mesh.TriangleCount);
            VertexCount = vertices;
            IndexCount = checked(3 * triangles);
            Grow(ref Positions, checked(3 * vertices));
            Grow(ref Normals, 3 * vertices);
            Grow(ref Colours, checked(4 * vertices));
            Grow(ref Indices, IndexCount);
            if (vertices > 0)
            {
                Marshal.Copy(mesh.Positions, Positions, 0, 3 * vertices);
                Marshal.Copy(mesh.Normals, Normals, 0, 3 * vertices);
            }
            if (triangles > 0)
            {
                Marshal.Copy(mesh.Indices, Indices, 0, IndexCount);
            }
            CopyColours(mesh.Colours, vertices);
            MirrorX();
            Measure();
        }

        private void CopyColours(IntPtr colours, int vertices)
        {
            if (colours == IntPtr.Zero)
            {
                for (int i = 0; i < 4 * vertices; i++)
                {
                    Colours[i] = 255;
                }
                return;
            }
            Grow(ref packed, 3 * vertices);
            Marshal.Copy(colours, packed, 0, 3 * vertices);
            for (int v = 0; v < vertices; v++)
            {
                Colours[4 * v] = packed[3 * v];
                Colours[4 * v + 1] = packed[3 * v + 1];
                Colours[4 * v + 2] = packed[3 * v + 2];
                Colours[4 * v + 3] = 255;
            }
        }

        private void MirrorX()
        {
            for (int i = 0; i < 3 * VertexCount; i += 3)
            {
                Positions[i] = -Positions[i];
                Normals[i] = -Normals[i];
            }
            for (int i = 0; i < IndexCount; i += 3)
            {
                int corner = Indices[i + 1];
                Indices[i + 1] = Indices[i + 2];
                Indices[i + 2] = corner;
            }
        }

        private void Measure()
        {
            for (int axis = 0; axis < 3; axis++)
            {
                Low[axis] = VertexCount > 0 ? float.MaxValue : 0;
                High[axis] = VertexCount > 0 ? float.MinValue : 0;
            }
            for (int i = 0; i < 3 * VertexCount; i++)
            {
                Low[i % 3] = Math.Min(Low[i % 3], Positions[i]);
                High[i % 3] = Math.Max(High[i % 3], Positions[i]);
            }
        }

        /// <summary>Makes an array long enough, with room to spare: frames differ a little.</summary>
        private static void Grow<T>(ref T[] array, int length)
        {
            if (array.Length < length)
            {
                array = new T[(int)Math.Min(int.MaxValue / 8, length + (long)length / 4)];
            }
            if (array.Length < length)
            {
                array = new T[length];
            }
        }
    }
}
