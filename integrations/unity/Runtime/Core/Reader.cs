using System;

namespace Isv
{
    /// <summary>Reads the frames of a stream in order, or from any frame on. One thread at a time.</summary>
    public sealed class Reader : IDisposable
    {
        private readonly ReaderHandle handle;

        private Reader(IntPtr handle)
        {
            this.handle = new ReaderHandle(handle);
        }

        /// <summary>Opens a stream in a file.</summary>
        /// <exception cref="IsvException">The file cannot be read, or is no stream.</exception>
        public static Reader Open(string path)
        {
            if (path == null)
            {
                throw new ArgumentNullException("path");
            }
            IntPtr reader;
            Native.Check(Native.isv_reader_open(Native.Utf8(path), out reader));
            return new Reader(reader);
        }

        /// <summary>Opens a stream in memory, such as a TextAsset's bytes. They are copied.</summary>
        /// <exception cref="IsvException">The bytes are no stream.</exception>
        public static Reader FromBytes(byte[] bytes)
        {
            if (bytes == null)
            {
                throw new ArgumentNullException("bytes");
            }
            IntPtr reader;
            Native.Check(Native.isv_reader_open_memory(bytes, (UIntPtr)(uint)bytes.Length, out reader));
            return new Reader(reader);
        }

        /// <summary>Version of the library: major * 65536 + minor * 256 + patch.</summary>
        public static uint LibraryVersion
        {
            get { return Native.isv_version(); }
        }

        /// <summary>Handles of the library that were not freed yet, of the whole process.</summary>
        public static long LiveHandles
        {
            get { return (long)(ulong)Native.isv_live_handles(); }
        }

        /// <summary>Number of frames; -1 if the stream has no sound index.</summary>
        public long FrameCount
        {
            get { return Info().FrameCount; }
        }

        /// <summary>Frames a second.</summary>
        public double Fps
        {
            get { return Info().Fps; }
        }

        /// <summary>Whether frames may have colour.</summary>
        public bool HasColour
        {
            get { return Info().HasColour != 0; }
        }

        /// <summary>Sets the level of detail from the next frame on: 1, 2 or 4.</summary>
        public void SetLevelOfDetail(int divisor)
        {
            Native.Check(Native.isv_reader_set_lod(handle, divisor < 0 ? 0 : (uint)divisor));
        }

        /// <summary>Leaves colour out from the next frame on.</summary>
        public void LeaveOutColour()
        {
            Native.Check(Native.isv_reader_leave_out_colour(handle));
        }

        /// <summary>Holds the last frame where packets are damaged or missing, in place of an error.</summary>
        public void HoldAfterLoss()
        {
            Native.Check(Native.isv_reader_set_after_loss(handle, 1));
        }

        /// <summary>Goes to a frame, counted from 0: the next one that is read.</summary>
        public void Seek(long frame)
        {
            Native.Check(Native.isv_reader_seek(handle, frame < 0 ? ulong.MaxValue : (ulong)frame));
        }

        /// <summary>Decodes the next frame into arrays. Returns false behind the last one.</summary>
        public bool Next(FrameArrays arrays)
        {
            if (arrays == null)
            {
                throw new ArgumentNullException("arrays");
            }
            IntPtr frame;
            if (Native.Check(Native.isv_reader_next_frame(handle, out frame)) == Native.End)
            {
                return false;
            }
            try
            {
                Native.FrameInfo info = new Native.FrameInfo();
                info.StructSize = Size(info);
                Native.Check(Native.isv_frame_get_info(frame, ref info));
                Native.Mesh mesh = new Native.Mesh();
                mesh.StructSize = Size(mesh);
                Native.Check(Native.isv_frame_get_mesh(frame, ref mesh));
                arrays.Copy(mesh);
                arrays.Number = (long)info.Number;
                arrays.Seconds = info.TimestampNs / 1e9;
                return true;
            }
            finally
            {
                Native.isv_frame_free(frame);
            }
        }

        /// <summary>Frees the reader.</summary>
        public void Dispose()
        {
            handle.Dispose();
        }

        private Native.StreamInfo Info()
        {
            Native.StreamInfo info = new Native.StreamInfo();
            info.StructSize = Size(info);
            Native.Check(Native.isv_reader_info(handle, ref info));
            return info;
        }

        private static UIntPtr Size<T>(T value) where T : struct
        {
            return (UIntPtr)(uint)System.Runtime.InteropServices.Marshal.SizeOf(typeof(T));
        }
    }
}
