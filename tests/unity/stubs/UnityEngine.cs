// A stub of Unity's engine: the signatures that the Unity package's C# uses, after Unity 6's scripting reference.
// Transforms, components and the console do what Unity's do as far as a test without the editor needs it; what is
// drawn, tracked or simulated does nothing.

using System;
using System.Collections.Generic;
using System.Linq;
using System.Text;

namespace UnityEngine {

[AttributeUsage(AttributeTargets.Class)]
public class AddComponentMenu : Attribute {
  public AddComponentMenu(string menuName) {}
}

[AttributeUsage(AttributeTargets.Class)]
public class DisallowMultipleComponent : Attribute {}

[AttributeUsage(AttributeTargets.Field)]
public class TooltipAttribute : Attribute {
  public TooltipAttribute(string tooltip) {}
}

public class Object {
  private string _name = "";

  public virtual string name {
    get => _name;
    set => _name = value;
  }

  public static implicit operator bool(Object exists) => exists != null;

  /// <summary>At once: below its parent an object is found no more.</summary>
  public static void Destroy(Object obj) {
    if (obj is GameObject gone) {
      gone.transform.parent = null;
    }
  }

  public static void DestroyImmediate(Object obj) {}
}

public class ScriptableObject : Object {}

public class TextAsset : Object {
  private readonly byte[] _bytes;

  public TextAsset(string text) {
    _bytes = Encoding.UTF8.GetBytes(text);
  }

  /// <summary>Unity imports one from a file.</summary>
  public TextAsset(byte[] imported) {
    _bytes = imported;
  }

  public byte[] bytes => (byte[])_bytes.Clone();

  public string text => Encoding.UTF8.GetString(_bytes);
}

// --- objects and components

public class GameObject : Object {
  private readonly List<Component> _components = new List<Component>();

  public GameObject() : this("New Game Object") {}

  public GameObject(string name) {
    this.name = name;
    transform = AddComponent<Transform>();
  }

  public Transform transform { get; }

  public T AddComponent<T>() where T : Component {
    var added = (T)Activator.CreateInstance(typeof(T), true);
    added.gameObject = this;
    _components.Add(added);
    if (added is TextMesh && GetComponent<MeshRenderer>() == null) {  // which it requires
      AddComponent<MeshRenderer>();
    }
    return added;
  }

  public T GetComponent<T>() => _components.OfType<T>().FirstOrDefault();

  public T[] GetComponentsInChildren<T>() =>
      _components.OfType<T>().Concat(transform.Children.SelectMany(
          child => child.gameObject.GetComponentsInChildren<T>())).ToArray();

  public static GameObject CreatePrimitive(PrimitiveType type) {
    var made = new GameObject(type.ToString());
    made.AddComponent<MeshRenderer>().sharedMaterial = new Material(Shader.Find("Standard"));
    return made;
  }
}

public enum PrimitiveType { Sphere, Capsule, Cylinder, Cube, Plane, Quad }

public class Component : Object {
  public GameObject gameObject { get; internal set; }

  public Transform transform => gameObject.transform;

  public override string name {
    get => gameObject.name;
    set => gameObject.name = value;
  }

  public T GetComponent<T>() => gameObject.GetComponent<T>();

  public T[] GetComponentsInChildren<T>() => gameObject.GetComponentsInChildren<T>();
}

public class Behaviour : Component {
  public bool enabled { get; set; } = true;

  public bool isActiveAndEnabled => enabled;
}

public class MonoBehaviour : Behaviour {}

/// <summary>Scales are 1.</summary>
public class Transform : Component {
  internal readonly List<Transform> Children = new List<Transform>();
  private Transform _parent;

  public Vector3 localPosition { get; set; }

  public Quaternion localRotation { get; set; } = Quaternion.identity;

  public Vector3 localScale { get; set; } = new Vector3(1, 1, 1);

  public Transform parent {
    get => _parent;
    set {
      _parent?.Children.Remove(this);
      _parent = value;
      _parent?.Children.Add(this);
    }
  }

  public Vector3 position {
    get => _parent == null ? localPosition : _parent.position + _parent.rotation * localPosition;
    set => localPosition =
        _parent == null ? value : Quaternion.Inverse(_parent.rotation) * (value - _parent.position);
  }

  public Quaternion rotation {
    get => _parent == null ? localRotation : _parent.rotation * localRotation;
    set => localRotation = _parent == null ? value : Quaternion.Inverse(_parent.rotation) * value;
  }

  public Vector3 forward => rotation * Vector3.forward;

  public void SetParent(Transform p, bool worldPositionStays) => parent = p;

  public void SetPositionAndRotation(Vector3 position, Quaternion rotation) {
    this.position = position;
    this.rotation = rotation;
  }

  public Vector3 InverseTransformDirection(Vector3 direction) => Quaternion.Inverse(rotation) * direction;

  public Vector3 TransformPoint(Vector3 point) => position + rotation * point;
}

// --- numbers

public struct Vector2 {
  public float x, y;

  public Vector2(float x, float y) {
    this.x = x;
    this.y = y;
  }
}

public struct Vector3 {
  public float x, y, z;

  public Vector3(float x, float y, float z) {
    this.x = x;
    this.y = y;
    this.z = z;
  }

  public static Vector3 forward => new Vector3(0, 0, 1);

  public static Vector3 zero => new Vector3();

  public static Vector3 one => new Vector3(1, 1, 1);

  public float sqrMagnitude => x * x + y * y + z * z;

  public Vector3 normalized => 1 / Mathf.Sqrt(sqrMagnitude) * this;

  public static Vector3 operator +(Vector3 a, Vector3 b) => new Vector3(a.x + b.x, a.y + b.y, a.z + b.z);

  public static Vector3 operator -(Vector3 a, Vector3 b) => new Vector3(a.x - b.x, a.y - b.y, a.z - b.z);

  public static Vector3 operator *(float d, Vector3 a) => new Vector3(d * a.x, d * a.y, d * a.z);
}

public struct Quaternion {
  public float x, y, z, w;

  public Quaternion(float x, float y, float z, float w) {
    this.x = x;
    this.y = y;
    this.z = z;
    this.w = w;
  }

  public static Quaternion identity => new Quaternion(0, 0, 0, 1);

  public static Quaternion Inverse(Quaternion rotation) =>
      new Quaternion(-rotation.x, -rotation.y, -rotation.z, rotation.w);

  public static Quaternion operator *(Quaternion p, Quaternion q) => new Quaternion(
      p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
      p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
      p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
      p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z);

  public static Vector3 operator *(Quaternion rotation, Vector3 point) {
    var turned = rotation * new Quaternion(point.x, point.y, point.z, 0) * Inverse(rotation);
    return new Vector3(turned.x, turned.y, turned.z);
  }
}

public static class Mathf {
  public static float Sqrt(float f) => (float)Math.Sqrt(f);
}

// --- names that the core has too

public struct Pose {}

public class Input {}

public class Event {}

// --- the engine's state

public static class Physics {
  public static Vector3 gravity { get; set; } = new Vector3(0, -9.81f, 0);
}

public static class Time {
  public static double realtimeSinceStartupAsDouble { get; set; }
  public static float unscaledTime { get; set; }
  public static float unscaledDeltaTime { get; set; }
  public static float deltaTime { get; set; }
  public static float fixedDeltaTime { get; set; } = 0.02f;
  public static float maximumDeltaTime { get; set; } = 1f / 3;
  public static float timeScale { get; set; } = 1;
}

public struct RefreshRate {
  public double value => 60;
}

public struct Resolution {
  public RefreshRate refreshRateRatio { get; set; }
}

public static class Screen {
  public static Resolution currentResolution => new Resolution();
}

public interface ISubsystem {}

public static class SubsystemManager {
  /// <summary>Not of Unity's: those that run.</summary>
  public static readonly List<ISubsystem> Running = new List<ISubsystem>();

  public static void GetSubsystems<T>(List<T> subsystems) where T : ISubsystem {
    subsystems.Clear();
    subsystems.AddRange(Running.OfType<T>());
  }
}

public static class Application {
  public static bool isPlaying { get; set; }
}

public static class JsonUtility {
  /// <summary>Not of Unity's: what reads, which a test sets.</summary>
  public static Func<string, Type, object> Read;

  public static T FromJson<T>(string json) => (T)Read(json, typeof(T));
}

public static class Debug {
  /// <summary>Not of Unity's: what was told, one after the other.</summary>
  public static readonly List<string> Told = new List<string>();

  public static void Log(object message) => Told.Add($"{message}");

  public static void LogWarning(object message, Object context) => Told.Add($"warning: {message}");

  public static void LogError(object message) => Told.Add($"error: {message}");

  public static void LogError(object message, Object context) => Told.Add($"error: {message}");
}

// --- what is drawn

public struct Color {
  public float r, g, b, a;

  public Color(float r, float g, float b, float a) {
    this.r = r;
    this.g = g;
    this.b = b;
    this.a = a;
  }

  public static Color red => new Color(1, 0, 0, 1);
  public static Color green => new Color(0, 1, 0, 1);
  public static Color white => new Color(1, 1, 1, 1);
  public static Color yellow => new Color(1, 0.92f, 0.016f, 1);
}

public class Shader : Object {
  public static Shader Find(string name) => new Shader { name = name };
}

public class Material : Object {
  public Material(Shader shader) {
    this.shader = shader;
  }

  public Shader shader { get; set; }

  public Color color { get; set; }
}

public class Renderer : Component {
  public Material sharedMaterial { get; set; }

  public Material material {
    get => sharedMaterial;
    set => sharedMaterial = value;
  }

  public bool enabled { get; set; } = true;
}

public class MeshRenderer : Renderer {}

public class LineRenderer : Renderer {
  public bool useWorldSpace { get; set; }
  public int positionCount { get; set; }
  public float widthMultiplier { get; set; }

  public void SetPosition(int index, Vector3 position) {}
}

public class Camera : Behaviour {
  /// <summary>In Unity the first that is tagged so; here what a test sets.</summary>
  public static Camera main { get; set; }
}

public enum TextAnchor { UpperLeft, UpperCenter, UpperRight, MiddleLeft, MiddleCenter }

public enum TextAlignment { Left, Center, Right }

public class Font : Object {
  public Material material { get; set; }
}

public static class Resources {
  public static T GetBuiltinResource<T>(string path) where T : Object, new() => new T { name = path };
}

public class TextMesh : Component {
  public Font font { get; set; }
  public string text { get; set; }
  public TextAnchor anchor { get; set; }
  public TextAlignment alignment { get; set; }
  public float characterSize { get; set; }
  public int fontSize { get; set; }
  public Color color { get; set; }
}
}

namespace UnityEngine.Rendering {

public class RenderPipelineAsset : ScriptableObject {
  public virtual Material defaultMaterial { get; set; }
}

public static class GraphicsSettings {
  public static RenderPipelineAsset currentRenderPipeline { get; set; }
}
}

namespace UnityEngine.SceneManagement {

public struct Scene {}
}

namespace UnityEngine.XR {

public enum XRNode { LeftEye, RightEye, CenterEye, Head, LeftHand, RightHand }

public struct InputFeatureUsage<T> {
  public string name { get; }

  public InputFeatureUsage(string usageName) {
    name = usageName;
  }
}

public static class CommonUsages {
  public static InputFeatureUsage<bool> isTracked = new InputFeatureUsage<bool>("IsTracked");
  public static InputFeatureUsage<bool> triggerButton = new InputFeatureUsage<bool>("TriggerButton");
  public static InputFeatureUsage<bool> gripButton = new InputFeatureUsage<bool>("GripButton");
  public static InputFeatureUsage<bool> primaryButton = new InputFeatureUsage<bool>("PrimaryButton");
  public static InputFeatureUsage<bool> secondaryButton = new InputFeatureUsage<bool>("SecondaryButton");
  public static InputFeatureUsage<bool> primary2DAxisClick = new InputFeatureUsage<bool>("Primary2DAxisClick");
  public static InputFeatureUsage<Vector2> primary2DAxis = new InputFeatureUsage<Vector2>("Primary2DAxis");
  public static InputFeatureUsage<Vector3> devicePosition = new InputFeatureUsage<Vector3>("DevicePosition");
  public static InputFeatureUsage<Quaternion> deviceRotation = new InputFeatureUsage<Quaternion>("DeviceRotation");
}

public struct InputDevice {
  public bool isValid => false;

  public bool TryGetFeatureValue(InputFeatureUsage<bool> usage, out bool value) {
    value = false;
    return false;
  }

  public bool TryGetFeatureValue(InputFeatureUsage<Vector2> usage, out Vector2 value) {
    value = new Vector2();
    return false;
  }

  public bool TryGetFeatureValue(InputFeatureUsage<Vector3> usage, out Vector3 value) {
    value = new Vector3();
    return false;
  }

  public bool TryGetFeatureValue(InputFeatureUsage<Quaternion> usage, out Quaternion value) {
    value = Quaternion.identity;
    return false;
  }
}

public class XRDisplaySubsystem : ISubsystem {
  /// <summary>Not of Unity's: the rate that a test sets.</summary>
  public float Rate;

  public bool running => true;

  public bool TryGetDisplayRefreshRate(out float displayRefreshRate) {
    displayRefreshRate = Rate;
    return true;
  }
}

[Flags]
public enum TrackingOriginModeFlags { Unknown = 0, Device = 1, Floor = 2 }

public class XRInputSubsystem : ISubsystem {
  private TrackingOriginModeFlags _origin = TrackingOriginModeFlags.Device;

  public bool running => true;

  public bool TrySetTrackingOriginMode(TrackingOriginModeFlags origin) {
    _origin = origin;
    return true;
  }

  public TrackingOriginModeFlags GetTrackingOriginMode() => _origin;
}

public static class InputDevices {
  public static InputDevice GetDeviceAtXRNode(XRNode node) => new InputDevice();
}
}
