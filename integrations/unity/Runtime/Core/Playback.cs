using System;
using System.Collections.Generic;
using System.Threading;

namespace Isv
{
    /// <summary>Plays a stream by a clock: a thread of its own decodes some frames ahead.</summary>
    public sealed class Playback : IDisposable
    {
        private readonly Reader reader;
        private readonly bool loops;
        private readonly double frameSeconds;
        private readonly Thread thread;
        private readonly object gate = new object();

        // All below belong to the gate.
        private readonly Queue<FrameArrays> ready = new Queue<FrameArrays>();
        private readonly Stack<FrameArrays> free = new Stack<FrameArrays>();
        private FrameArrays shown;
        private Exception failure;
        private bool hasEnded;
        private bool isStopped;

        /// <summary>Starts to decode. The reader is the playback's from now on, and is freed with it.</summary>
        /// <param name="reader">A reader at the frame to begin with.</param>
        /// <param name="loops">Whether the first frame follows the last one.</param>
        /// <param name="ahead">Frames to decode ahead, at least 1.</param>
        public Playback(Reader reader, bool loops, int ahead)
        {
            if (reader == null)
            {
                throw new ArgumentNullException("reader");
            }
            if (ahead < 1)
            {
                throw new ArgumentOutOfRangeException("ahead");
            }
            this.reader = reader;
            this.loops = loops;
            frameSeconds = reader.Fps > 0 ? 1 / reader.Fps : 0;
            for (int i = 0; i <= ahead; i++)
            {
                free.Push(new FrameArrays());
            }
            thread = new Thread(Decode) { IsBackground = true, Name = "isv playback" };
            thread.Start();
        }

        /// <summary>Whether all frames were taken. Never where the stream loops.</summary>
        public bool HasEnded
        {
            get
            {
                lock (gate)
                {
                    return hasEnded && ready.Count == 0;
                }
            }
        }

        /// <summary>Takes the frame to show at a time (s) from the start, loops included. Null if what is shown stays.</summary>
        /// <remarks>The arrays are good until the next call. Frames between are left out.</remarks>
        /// <exception cref="IsvException">A frame could not be decoded.</exception>
        public FrameArrays Take(double seconds)
        {
            lock (gate)
            {
                FrameArrays taken = null;
                while (ready.Count > 0 && ready.Peek().Seconds <= seconds)
                {
                    if (taken != null)
                    {
                        free.Push(taken);
                    }
                    taken = ready.Dequeue();
                }
                if (taken != null)
                {
                    if (shown != null)
                    {
                        free.Push(shown);
                    }
                    shown = taken;
                    Monitor.PulseAll(gate);
                }
                else if (failure != null && ready.Count == 0)
                {
                    Exception thrown = failure;
                    failure = null;
                    throw thrown;
                }
                return taken;
            }
        }

        /// <summary>Stops the thread and frees the reader.</summary>
        public void Dispose()
        {
            lock (gate)
            {
                isStopped = true;
                Monitor.PulseAll(gate);
            }
            thread.Join();
            reader.Dispose();
        }

        private void Decode()
        {
            // Where the frames of this round begin, when its first frame was taken, and the time right behind its last one. Frames are
            // stamped from any start on, and pauses between them count.
            double start = 0;
            double first = 0;
            double end = 0;
            try
            {
                long decoded = 0;
                while (true)
                {
                    FrameArrays arrays = FreeArrays();
                    if (arrays == null)
                    {
                        return;
                    }
                    bool isThere = reader.Next(arrays);
                    lock (gate)
                    {
                        if (isThere)
                        {
                            first = decoded++ == 0 ? arrays.Seconds : first;
                            arrays.Seconds += start - first;
                            end = arrays.Seconds + frameSeconds;
                            ready.Enqueue(arrays);
                            continue;
                        }
                        free.Push(arrays);
                        // A stream without a frame or a length would loop on the spot.
                        if (!loops || decoded == 0 || end <= start)
                        {
                            hasEnded = true;
                            return;
                        }
                    }
                    start = end;
                    decoded = 0;
                    reader.Seek(0);
                }
            }
            catch (Exception error)
            {
                lock (gate)
                {
                    failure = error;
                    hasEnded = true;
                }
            }
        }

        /// <summary>Arrays that nobody uses, once there are any. Null when the playback stops.</summary>
        private FrameArrays FreeArrays()
        {
            lock (gate)
            {
                while (free.Count == 0 && !isStopped)
                {
                    Monitor.Wait(gate);
                }
                return isStopped ? null : free.Pop();
            }
        }
    }
}
