// A stub of MuJoCo's package for Unity (org.mujoco): the signatures that the Unity package's C# uses, and no more.
// Written after the plug-in's source, `unity/` of google-deepmind/mujoco at commit a725507; `signatures.yaml` beside it
// names the file of each. It simulates nothing.

using System;
using UnityEngine;

namespace Mujoco {

public static class MujocoLib {
  public const double mjMAXVAL = 10000000000.0;
  public const int mjVERSION_HEADER = 3012001;

  public unsafe struct mjOption_ {
    public double timestep;
  }

  public unsafe struct mjModel_ {
    public UInt64 nq;
    public UInt64 nv;
    public UInt64 na;
    public mjOption_ opt;
    public double* qpos0;
    public double* jnt_stiffness;
    public double* jnt_stiffnesspoly;
    public double* dof_frictionloss;
    public double* dof_damping;
    public double* dof_dampingpoly;
    public double* tendon_stiffness;
    public double* tendon_stiffnesspoly;
    public double* tendon_frictionloss;
    public int* actuator_actadr;
  }

  public unsafe struct mjData_ {
    public double time;
    public fixed double energy[2];
    public double* qpos;
    public double* qvel;
    public double* act;
    public double* ctrl;
  }

  public static unsafe int mj_version() => mjVERSION_HEADER;

  public static unsafe mjData_* mj_makeData(mjModel_* m) => null;

  public static unsafe void mj_deleteData(mjData_* d) {}

  public static unsafe void mj_step(mjModel_* m, mjData_* d) {}

  public static unsafe void mj_forward(mjModel_* m, mjData_* d) {}

  public static unsafe void mj_energyVel(mjModel_* m, mjData_* d) {}
}

public abstract class MjComponent : MonoBehaviour {
  public int MujocoId { get; protected set; }
}

public abstract class MjBaseBody : MjComponent {}

public class MjBody : MjBaseBody {}

public class MjMocapBody : MjBaseBody {}

public abstract class MjBaseJoint : MjComponent {
  public int QposAddress { get; private set; } = -1;
  public int DofAddress { get; private set; } = -1;
}

public class MjHingeJoint : MjBaseJoint {}

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

#pragma warning disable 67  // nothing raises them here
  public event EventHandler<MjStepArgs> postInitEvent;
  public event EventHandler<MjStepArgs> preUpdateEvent;
  public event EventHandler<MjStepArgs> postUpdateEvent;
#pragma warning restore 67

  public unsafe void SyncUnityToMjState() {}
}
}
