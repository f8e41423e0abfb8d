// A stub of Unity's inference engine (com.unity.ai.inference 2.2 and later): the signatures that the Unity package's C#
// uses, after its scripting reference. A model answers by a function that the test sets.

using System;
using System.Collections.Generic;
using UnityEngine;

namespace Unity.InferenceEngine {

public class ModelAsset : ScriptableObject {
  /// <summary>Not of Unity's: what the model takes, gives and answers.</summary>
  public int Width;
  public string[] Outputs;
  public Func<float[], int, Dictionary<string, float[]>> Answer;
}

public struct DynamicTensorShape {
  private readonly int[] _sizes;

  public DynamicTensorShape(int d0, int d1) {
    _sizes = new[] { d0, d1 };
  }

  public int Get(int axis) => _sizes[axis];
}

public readonly struct TensorShape {
  public readonly int length;

  public TensorShape(int d0, int d1) {
    length = d0 * d1;
  }
}

public class Model {
  public struct Input {
    public string name;
    public DynamicTensorShape shape;
  }

  public struct Output {
    public string name;
  }

  public List<Input> inputs = new List<Input>();
  public List<Output> outputs = new List<Output>();
  internal ModelAsset Asset;
}

public static class ModelLoader {
  public static Model Load(ModelAsset modelAsset) {
    var model = new Model { Asset = modelAsset };
    model.inputs.Add(new Model.Input { name = "pose", shape = new DynamicTensorShape(-1, modelAsset.Width) });
    foreach (string name in modelAsset.Outputs) {
      model.outputs.Add(new Model.Output { name = name });
    }
    return model;
  }
}

public enum BackendType { GPUCompute, CPU, GPUPixel }

public abstract class Tensor : IDisposable {
  public void Dispose() {}
}

public class Tensor<T> : Tensor {
  private readonly T[] _values;

  public Tensor(TensorShape shape, T[] srcData, int dataStartIndex = 0) {
    if (srcData.Length != shape.length) {
      throw new ArgumentException("a tensor's data is of another length than its shape");
    }
    _values = srcData;
  }

  public T[] DownloadToArray() => (T[])_values.Clone();
}

public class Worker : IDisposable {
  private readonly Model _model;
  private Dictionary<string, float[]> _answers;

  public Worker(Model model, BackendType backendType) {
    _model = model;
  }

  public void Schedule(Tensor input) {
    var values = ((Tensor<float>)input).DownloadToArray();
    _answers = _model.Asset.Answer(values, values.Length / _model.Asset.Width);
  }

  public Tensor PeekOutput(string name) =>
      new Tensor<float>(new TensorShape(1, _answers[name].Length), _answers[name]);

  public void Dispose() {}
}
}
