// MuJoCo's package for Unity (org.mujoco) as far as Twin.cs needs it, but in place of a stub one that simulates: what
// MjScene.cs does to libmujoco, in its order. Models come compiled, from files, with the numbers of what is in them.
//
// The plug-in's structs are those of libmujoco; these have the fields that Twin.cs reads, and point into the real ones.
// Where a field is in those, the test finds out and tells.

using System;
using System.Collections.Generic;
using System.Linq;
using System.Runtime.InteropServices;
using UnityEngine;

namespace Mujoco {

public static unsafe class MujocoLib {
  public const double mjMAXVAL = 10000000000.0;

  /// <summary>In the plug-in a constant.</summary>
  public static int mjVERSION_HEADER;

  /// <summary>Bytes from the start of the real struct to each field, by its name.</summary>
  public static Dictionary<string, int> ModelFields, DataFields;

  /// <summary>Sizes of the model that was loaded last.</summary>
  public static int Nq, Nv;

  public struct mjOption_ {
    public double timestep;
  }

  public struct mjModel_ {
    public UInt64 nq, nv;
    public mjOption_ opt;
    public double* qpos0, jnt_stiffness, jnt_stiffnesspoly, dof_frictionloss, dof_damping, dof_dampingpoly;
    public double* tendon_stiffness, tendon_stiffnesspoly, tendon_frictionloss;
    public int* actuator_actadr;
    internal byte* Real;
  }

  public struct mjData_ {
    public fixed double energy[2];
    public double* qpos, qvel, act, ctrl;
    internal byte* Real;
  }

  [DllImport("mujoco", EntryPoint = "mj_loadModel")]
  private static extern byte* LoadModel(string file, IntPtr vfs);

  [DllImport("mujoco", EntryPoint = "mj_makeData")]
  private static extern byte* MakeData(byte* m);

  [DllImport("mujoco", EntryPoint = "mj_deleteData")]
  private static extern void DeleteData(byte* d);

  [DllImport("mujoco", EntryPoint = "mj_step")]
  private static extern void Step(byte* m, byte* d);

  [DllImport("mujoco", EntryPoint = "mj_forward")]
  private static extern void Forward(byte* m, byte* d);

  [DllImport("mujoco", EntryPoint = "mj_energyVel")]
  private static extern void EnergyVel(byte* m, byte* d);

  [DllImport("mujoco", EntryPoint = "mj_resetData")]
  private static extern void ResetData(byte* m, byte* d);

  [DllImport("mujoco")]
  public static extern int mj_version();

  public static mjModel_* Load(string file) {
    var m = (mjModel_*)Marshal.AllocHGlobal(sizeof(mjModel_));
    *m = new mjModel_ { nq = (UInt64)Nq, nv = (UInt64)Nv, Real = LoadModel(file, IntPtr.Zero) };
    m->opt.timestep = *(double*)(m->Real + ModelFields["timestep"]);
    m->qpos0 = Field(m->Real, ModelFields, "qpos0");
    m->jnt_stiffness = Field(m->Real, ModelFields, "jnt_stiffness");
    m->jnt_stiffnesspoly = Field(m->Real, ModelFields, "jnt_stiffnesspoly");
    m->dof_frictionloss = Field(m->Real, ModelFields, "dof_frictionloss");
    m->dof_damping = Field(m->Real, ModelFields, "dof_damping");
    m->dof_dampingpoly = Field(m->Real, ModelFields, "dof_dampingpoly");
    m->tendon_stiffness = Field(m->Real, ModelFields, "tendon_stiffness");
    m->tendon_stiffnesspoly = Field(m->Real, ModelFields, "tendon_stiffnesspoly");
    m->tendon_frictionloss = Field(m->Real, ModelFields, "tendon_frictionloss");
    m->actuator_actadr = (int*)Field(m->Real, ModelFields, "actuator_actadr");
    return m;
  }

  public static mjData_* mj_makeData(mjModel_* m) {
    var d = (mjData_*)Marshal.AllocHGlobal(sizeof(mjData_));
    *d = new mjData_ { Real = MakeData(m->Real) };
    d->qpos = Field(d->Real, DataFields, "qpos");
    d->qvel = Field(d->Real, DataFields, "qvel");
    d->act = Field(d->Real, DataFields, "act");
    d->ctrl = Field(d->Real, DataFields, "ctrl");
    return d;
  }

  private static double* Field(byte* real, Dictionary<string, int> fields, string name) =>
      *(double**)(real + fields[name]);

  public static void mj_deleteData(mjData_* d) => DeleteData(d->Real);

  public static void mj_step(mjModel_* m, mjData_* d) {
    *(double*)(m->Real + ModelFields["timestep"]) = m->opt.timestep;
    Step(m->Real, d->Real);
  }

  public static void mj_forward(mjModel_* m, mjData_* d) => Forward(m->Real, d->Real);

  public static void mj_resetData(mjModel_* m, mjData_* d) => ResetData(m->Real, d->Real);

  public static void mj_energyVel(mjModel_* m, mjData_* d) {
    EnergyVel(m->Real, d->Real);
    d->energy[1] = ((double*)(d->Real + DataFields["energy"]))[1];
  }
}

public abstract class MjComponent : MonoBehaviour {
  public int MujocoId { get; set; }
}

public class MjHingeJoint : MjComponent {
  public int QposAddress { get; set; } = -1;
  public int DofAddress { get; set; } = -1;
}

public abstract class MjBaseTendon : MjComponent {}

public class MjFixedTendon : MjBaseTendon {}

public class MjActuator : MjComponent {
  public float Control;
}

public class MjStepArgs : EventArgs {
  public unsafe MjStepArgs(MujocoLib.mjModel_* model, MujocoLib.mjData_* data) {
    this.model = model;
    this.data = data;
  }

  public readonly unsafe MujocoLib.mjModel_* model;
  public readonly unsafe MujocoLib.mjData_* data;
}

public class MjScene : MonoBehaviour {
  public unsafe MujocoLib.mjModel_* Model = null;
  public unsafe MujocoLib.mjData_* Data = null;
  public bool SceneRecreationAtLateUpdateRequested = false;

  private static MjScene _instance = null;

  public static MjScene Instance =>
      _instance ?? (_instance = new GameObject("MjScene").AddComponent<MjScene>());

  public static bool InstanceExists => _instance != null;

  public event EventHandler<MjStepArgs> postInitEvent;
  public event EventHandler<MjStepArgs> preUpdateEvent;
  public event EventHandler<MjStepArgs> postUpdateEvent;

  /// <summary>What is in the scene, and gives each its numbers in the model of a file.</summary>
  public Func<IEnumerable<MjComponent>> Components;
  public Action<string> Bind;

  public unsafe void CreateScene(string file) {
    Bind(file);
    Model = MujocoLib.Load(file);
    Data = MujocoLib.mj_makeData(Model);
    postInitEvent?.Invoke(this, new MjStepArgs(Model, Data));
  }

  /// <summary>`CreateScene(skipCompile: true)`, which writes the scene's MJCF and compiles none.</summary>
  public unsafe void WriteScene() => postInitEvent?.Invoke(this, new MjStepArgs(null, null));

  public unsafe void FixedUpdate() {
    preUpdateEvent?.Invoke(this, new MjStepArgs(Model, Data));
    MujocoLib.mj_step(Model, Data);
    SyncUnityToMjState();
    postUpdateEvent?.Invoke(this, new MjStepArgs(Model, Data));
  }

  public unsafe void RecreateScene(string file) {
    var kept = new Dictionary<MjHingeJoint, double[]>();
    foreach (var joint in Components().OfType<MjHingeJoint>().Where(one => one.QposAddress > -1)) {
      kept[joint] = new[] { Data->qpos[joint.QposAddress], Data->qvel[joint.DofAddress] };
    }
    MujocoLib.mj_resetData(Model, Data);
    SyncUnityToMjState();
    CreateScene(file);
    foreach (var joint in kept.Keys) {
      Data->qpos[joint.QposAddress] = kept[joint][0];
      Data->qvel[joint.DofAddress] = kept[joint][1];
    }
    SyncUnityToMjState();
  }

  public unsafe void SyncUnityToMjState() {
    foreach (var actuator in Components().OfType<MjActuator>()) {
      Data->ctrl[actuator.MujocoId] = actuator.Control;
    }
  }
}
}
