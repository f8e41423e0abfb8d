using System;
using System.Collections.Generic;
using Unity.InferenceEngine;

namespace Trunkline {

/// <summary>The package's network, run by Unity's inference engine.</summary>
public sealed class InferenceNetwork : INetwork, IDisposable {
  private readonly Model _model;
  private readonly Worker _worker;

  /// <param name="file">Runtime/Network/ik.onnx, as Unity has imported it.</param>
  /// <param name="backend">The processor is the fastest for so small a network, and answers at once.</param>
  public InferenceNetwork(ModelAsset file, BackendType backend = BackendType.CPU) {
    _model = ModelLoader.Load(file);
    _worker = new Worker(_model, backend);
    Inputs = _model.inputs.Count == 1 ? Math.Max(_model.inputs[0].shape.Get(1), 0) : 0;
    var widths = new List<int>();
    if (Inputs > 0) {  // the engine tells the width of an output by giving one
      foreach (var answer in Run(new float[Inputs], 1)) {
        widths.Add(answer.Value.Length);
      }
    }
    Outputs = widths;
  }

  /// <inheritdoc/>
  public int Inputs { get; }

  /// <inheritdoc/>
  public IReadOnlyList<int> Outputs { get; }

  /// <inheritdoc/>
  public IReadOnlyDictionary<string, float[]> Run(float[] poses, int count) {
    var answers = new Dictionary<string, float[]>();
    using (var input = new Tensor<float>(new TensorShape(count, Inputs), poses)) {
      _worker.Schedule(input);
      foreach (var output in _model.outputs) {
        answers[output.name] = ((Tensor<float>)_worker.PeekOutput(output.name)).DownloadToArray();
      }
    }
    return answers;
  }

  public void Dispose() => _worker.Dispose();
}
}
