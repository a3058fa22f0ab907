// The members of Unity's types that the package uses, with the signatures of Unity 2021.3, and nothing in them: IsvPlayer.cs is
// compiled against these where there is no Unity. It is never run with them.
using System;

namespace Unity.Collections
{
    public struct NativeArray<T> where T : struct
    {
        public static void Copy(T[] src, int srcIndex, NativeArray<T> dst, int dstIndex, int length)
        {
        }
    }
}

namespace UnityEngine.Rendering
{
    public enum VertexAttribute
    {
        Position,
        Normal,
        Color = 3,
    }

    public enum VertexAttributeFormat
    {
        Float32,
        UNorm8 = 2,
    }

    public enum IndexFormat
    {
        UInt16,
        UInt32,
    }

    [Flags]
    public enum MeshUpdateFlags
    {
        Default = 0,
        DontValidateIndices = 1,
        DontRecalculateBounds = 8,
    }

    public struct VertexAttributeDescriptor
    {
        public VertexAttributeDescriptor(VertexAttribute attribute, VertexAttributeFormat format, int dimension, int stream)
        {
        }
    }

    public struct SubMeshDescriptor
    {
        public SubMeshDescriptor(int indexStart, int indexCount, MeshTopology topology = MeshTopology.Triangles)
        {
        }
    }
}

namespace UnityEngine
{
    using Unity.Collections;
    using UnityEngine.Rendering;

    public enum MeshTopology
    {
        Triangles,
    }

    public class Object
    {
        public string name { get; set; }

        public static void Destroy(Object obj)
        {
        }
    }

    public class Component : Object
    {
        public T GetComponent<T>()
        {
            return default(T);
        }
    }

    public class MonoBehaviour : Component
    {
    }

    public class MeshFilter : Component
    {
        public Mesh sharedMesh { get; set; }
    }

    public class MeshRenderer : Component
    {
    }

    [AttributeUsage(AttributeTargets.Class, AllowMultiple = true)]
    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type requiredComponent)
        {
        }
    }

    public sealed class AddComponentMenu : Attribute
    {
        public AddComponentMenu(string menuName)
        {
        }
    }

    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string tooltip)
        {
        }
    }

    public sealed class RangeAttribute : Attribute
    {
        public RangeAttribute(float min, float max)
        {
        }
    }

    public static class Application
    {
        public static string streamingAssetsPath
        {
            get { return ""; }
        }
    }

    public static class Time
    {
        public static float deltaTime
        {
            get { return 0; }
        }
    }

    public static class Debug
    {
        public static void LogError(object message, Object context)
        {
        }
    }

    public struct Vector3
    {
        public Vector3(float x, float y, float z)
        {
        }

        public static Vector3 operator +(Vector3 a, Vector3 b)
        {
            return a;
        }

        public static Vector3 operator -(Vector3 a, Vector3 b)
        {
            return a;
        }

        public static Vector3 operator /(Vector3 a, float d)
        {
            return a;
        }
    }

    public struct Bounds
    {
        public Bounds(Vector3 center, Vector3 size)
        {
        }
    }

    public sealed class Mesh : Object
    {
        public Bounds bounds { get; set; }

        public void MarkDynamic()
        {
        }

        public static MeshDataArray AllocateWritableMeshData(int meshCount)
        {
            return default(MeshDataArray);
        }

        public static void ApplyAndDisposeWritableMeshData(MeshDataArray data, Mesh mesh, MeshUpdateFlags flags = MeshUpdateFlags.Default)
        {
        }

        public struct MeshDataArray
        {
            public MeshData this[int index]
            {
                get { return default(MeshData); }
            }
        }

        public struct MeshData
        {
            public int subMeshCount { get; set; }

            public void SetVertexBufferParams(int vertexCount, params VertexAttributeDescriptor[] attributes)
            {
            }

            public void SetIndexBufferParams(int indexCount, IndexFormat format)
            {
            }

            public NativeArray<T> GetVertexData<T>(int stream = 0) where T : struct
            {
                return default(NativeArray<T>);
            }

            public NativeArray<T> GetIndexData<T>() where T : struct
            {
                return default(NativeArray<T>);
            }

            public void SetSubMesh(int index, SubMeshDescriptor desc, MeshUpdateFlags flags = MeshUpdateFlags.Default)
            {
            }
        }
    }
}
