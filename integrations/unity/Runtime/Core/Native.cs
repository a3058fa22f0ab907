using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Isv
{
    /// <summary>An error of the C library, with its words.</summary>
    public sealed class IsvException : Exception
    {
        internal IsvException(int status, string message)
            : base(message)
        {
            Status = status;
        }

        /// <summary>Number of the error, as in isv.h: ISV_ERROR_INPUT is -6, ISV_ERROR_STREAM is -8.</summary>
        public int Status { get; private set; }
    }

    /// <summary>Handle of a reader, which frees itself.</summary>
    internal sealed class ReaderHandle : SafeHandle
    {
        internal ReaderHandle(IntPtr handle)
            : base(IntPtr.Zero, true)
        {
            SetHandle(handle);
        }

        public override bool IsInvalid
        {
            get { return handle == IntPtr.Zero; }
        }

        protected override bool ReleaseHandle()
        {
            return Native.isv_reader_free(handle) == Native.Ok;
        }
    }

    /// <summary>The calls of isv.h that players need.</summary>
    internal static class Native
    {
        internal const int Ok = 0;
        internal const int End = 1;

        /// <summary>Name of the library: libisv.so, libisv.dylib or isv.dll.</summary>
        private const string Library = "isv";

        [StructLayout(LayoutKind.Sequential)]
        internal struct StreamInfo
        {
            internal UIntPtr StructSize;
            internal long FrameCount;
            internal double Fps;
            internal double VoxelMetres;
            internal int HasColour;
            internal int CanSeek;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct FrameInfo
        {
            internal UIntPtr StructSize;
            internal ulong Number;
            internal ulong TimestampNs;
        }

        [StructLayout(LayoutKind.Sequential)]
        internal struct Mesh
        {
            internal UIntPtr StructSize;
            internal UIntPtr VertexCount;
            internal UIntPtr TriangleCount;
            internal IntPtr Positions;
            internal IntPtr Normals;
            internal IntPtr Colours;
            internal IntPtr Indices;
        }

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern IntPtr isv_error_message();

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern uint isv_version();

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern UIntPtr isv_live_handles();

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_open(byte[] path, out IntPtr reader);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_open_memory(byte[] bytes, UIntPtr size, out IntPtr reader);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_free(IntPtr reader);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_info(ReaderHandle reader, ref StreamInfo info);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_set_lod(ReaderHandle reader, uint divisor);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_leave_out_colour(ReaderHandle reader);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_set_after_loss(ReaderHandle reader, int afterLoss);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_seek(ReaderHandle reader, ulong frame);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_reader_next_frame(ReaderHandle reader, out IntPtr frame);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_frame_free(IntPtr frame);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_frame_get_info(IntPtr frame, ref FrameInfo info);

        [DllImport(Library, CallingConvention = CallingConvention.Cdecl)]
        internal static extern int isv_frame_get_mesh(IntPtr frame, ref Mesh mesh);

        /// <summary>Throws for an error.</summary>
        internal static int Check(int status)
        {
            if (status < Ok)
            {
                throw new IsvException(status, Text(isv_error_message()));
            }
            return status;
        }

        /// <summary>UTF-8 with a 0 at its end.</summary>
        internal static byte[] Utf8(string text)
        {
            if (text.IndexOf('\0') >= 0)
            {
                throw new ArgumentException("a path has no zero character", "text");
            }
            return Encoding.UTF8.GetBytes(text + "\0");
        }

        private static string Text(IntPtr pointer)
        {
            int length = 0;
            while (Marshal.ReadByte(pointer, length) != 0)
            {
                length++;
            }
            byte[] bytes = new byte[length];
            Marshal.Copy(pointer, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }
    }
}
