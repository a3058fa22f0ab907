using System;
using System.IO;
using Unity.Collections;
using UnityEngine;
using UnityEngine.Rendering;

namespace Isv
{
    /// <summary>Plays a stream into the mesh of this object.</summary>
    /// <remarks>Its material needs vertex colours to show those of the stream.</remarks>
    [RequireComponent(typeof(MeshFilter))]
    [RequireComponent(typeof(MeshRenderer))]
    [AddComponentMenu("isv/isv player")]
    public sealed class IsvPlayer : MonoBehaviour
    {
        /// <summary>Path of the stream, whole or below the folder StreamingAssets.</summary>
        [Tooltip("Path of the stream, whole or below the folder StreamingAssets")]
        public string path = "take.isv";

        /// <summary>Whether the first frame follows the last one.</summary>
        public bool loops = true;

        /// <summary>Speed: 1 is the stream's own.</summary>
        [Range(0, 4)]
        public float speed = 1;

        /// <summary>Level of detail: 1, 2 or 4.</summary>
        [Tooltip("1 for all voxels, 2 for half and 4 for a quarter of the resolution")]
        public int levelOfDetail = 1;

        private static readonly VertexAttributeDescriptor[] Layout =
        {
            new VertexAttributeDescriptor(VertexAttribute.Position, VertexAttributeFormat.Float32, 3, 0),
            new VertexAttributeDescriptor(VertexAttribute.Normal, VertexAttributeFormat.Float32, 3, 1),
            new VertexAttributeDescriptor(VertexAttribute.Color, VertexAttributeFormat.UNorm8, 4, 2),
        };

        private Playback playback;
        private Mesh mesh;
        private double seconds;

        /// <summary>Number of the frame that is shown; -1 before the first.</summary>
        public long Frame { get; private set; }

        private void OnEnable()
        {
            Frame = -1;
            seconds = 0;
            mesh = new Mesh { name = "isv" };
            mesh.MarkDynamic();
            GetComponent<MeshFilter>().sharedMesh = mesh;
            try
            {
                Reader reader = Reader.Open(Path.Combine(Application.streamingAssetsPath, path));
                try
                {
                    reader.SetLevelOfDetail(levelOfDetail);
                    playback = new Playback(reader, loops, 3);
                }
                catch
                {
                    reader.Dispose();
                    throw;
                }
            }
            catch (IsvException error)
            {
                Debug.LogError(error.Message, this);
            }
        }

        private void OnDisable()
        {
            if (playback != null)
            {
                playback.Dispose();
                playback = null;
            }
            GetComponent<MeshFilter>().sharedMesh = null;
            Destroy(mesh);
        }

        private void Update()
        {
            if (playback == null)
            {
                return;
            }
            seconds += Time.deltaTime * speed;
            try
            {
                FrameArrays frame = playback.Take(seconds);
                if (frame != null)
                {
                    Show(frame);
                }
            }
            catch (IsvException error)
            {
                Debug.LogError(error.Message, this);
            }
        }

        private void Show(FrameArrays frame)
        {
            Mesh.MeshDataArray made = Mesh.AllocateWritableMeshData(1);
            Mesh.MeshData data = made[0];
            data.SetVertexBufferParams(frame.VertexCount, Layout);
            data.SetIndexBufferParams(frame.IndexCount, IndexFormat.UInt32);
            NativeArray<float>.Copy(frame.Positions, 0, data.GetVertexData<float>(0), 0, 3 * frame.VertexCount);
            NativeArray<float>.Copy(frame.Normals, 0, data.GetVertexData<float>(1), 0, 3 * frame.VertexCount);
            NativeArray<byte>.Copy(frame.Colours, 0, data.GetVertexData<byte>(2), 0, 4 * frame.VertexCount);
            NativeArray<int>.Copy(frame.Indices, 0, data.GetIndexData<int>(), 0, frame.IndexCount);
            // Indices and bounds are known to be right: Unity need not look.
            const MeshUpdateFlags Trusted = MeshUpdateFlags.DontValidateIndices | MeshUpdateFlags.DontRecalculateBounds;
            data.subMeshCount = 1;
            data.SetSubMesh(0, new SubMeshDescriptor(0, frame.IndexCount), Trusted);
            Mesh.ApplyAndDisposeWritableMeshData(made, mesh, Trusted);
            Vector3 low = new Vector3(frame.Low[0], frame.Low[1], frame.Low[2]);
            Vector3 high = new Vector3(frame.High[0], frame.High[1], frame.High[2]);
            mesh.bounds = new Bounds((low + high) / 2, high - low);
            Frame = frame.Number;
        }
    }
}
