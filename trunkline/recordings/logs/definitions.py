"""ROS 2 definitions of the messages that logs are written in, as the recorder of ROS 2 puts them into a log."""

SEPARATOR = "=" * 80 + "\n"
HEADER = f"""{SEPARATOR}MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{SEPARATOR}MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
POINT = f"""{SEPARATOR}MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
"""
QUATERNION = f"""{SEPARATOR}MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
VECTOR3 = f"""{SEPARATOR}MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
MARKER = f"""{SEPARATOR}MSG: mocap4r2_msgs/Marker
int8 USE_NAME=0
int8 USE_INDEX=1
int8 USE_BOTH=2
int8 id_type
int32 marker_index
string marker_name
geometry_msgs/Point translation
"""
# mocap4r2_msgs of the MOCAP4ROS2 project
RIGID_BODIES = f"""std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/RigidBody[] rigidbodies
{HEADER}{SEPARATOR}MSG: mocap4r2_msgs/RigidBody
string rigid_body_name
mocap4r2_msgs/Marker[] markers
geometry_msgs/Pose pose
{MARKER}{SEPARATOR}MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{POINT}{SEPARATOR}MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
"""
MARKERS = f"""std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/Marker[] markers
{HEADER}{MARKER}{POINT}"""
OLDER_MARKERS = f"""std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/Marker[] markers
{HEADER}{SEPARATOR}MSG: mocap4r2_msgs/Marker
int64 index
geometry_msgs/Point translation
{POINT}"""
JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}"""
# interfaces of the ASL Trunk robot, StanfordASL/trunk-stack
TRUNK_RIGID_BODIES = f"""std_msgs/Header header
uint32 frame_number
string[] rigid_body_names
geometry_msgs/Point[] positions
geometry_msgs/Quaternion[] orientations
{HEADER}{POINT}{QUATERNION}"""
POSE = f"""{SEPARATOR}MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{POINT}{QUATERNION}"""
NAMED_POSE = f"""{SEPARATOR}MSG: motion_capture_tracking_interfaces/NamedPose
string name
geometry_msgs/Pose pose
{POSE}"""
# of vicon_receiver, OPT4SMART/ros2-vicon-receiver, below a header since its later versions
POSITION = """float32 x_trans
float32 y_trans
float32 z_trans
float32 x_rot
float32 y_rot
float32 z_rot
float32 w
string segment_name
string subject_name
int32 frame_number
string translation_type
"""
# of Foxglove's package for ROS 2
FRAME_TRANSFORM = f"""builtin_interfaces/Time timestamp
string parent_frame_id
string child_frame_id
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{VECTOR3}{QUATERNION}"""
TRANSFORM_STAMPED = f"""std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{HEADER}{SEPARATOR}MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{VECTOR3}{QUATERNION}"""
LAYOUT = f"""std_msgs/MultiArrayLayout layout
{{kind}}[] data
{SEPARATOR}MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
{SEPARATOR}MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
# what a message of that name usually is, for logs whose recorder could not find the definition
KNOWN = {
    "mocap4r2_msgs/RigidBodies": RIGID_BODIES,
    "mocap_msgs/RigidBodies": RIGID_BODIES,
    "mocap4r2_msgs/Markers": MARKERS,
    "mocap_msgs/Markers": MARKERS,
    "sensor_msgs/JointState": JOINT_STATE,
    "interfaces/TrunkRigidBodies": TRUNK_RIGID_BODIES,
    "motion_capture_tracking_interfaces/NamedPoseArray": f"""std_msgs/Header header
motion_capture_tracking_interfaces/NamedPose[] poses
{HEADER}{NAMED_POSE}""",
    "motion_capture_tracking_interfaces/NamedPoseArrayV2": f"""std_msgs/Header header
uint64 timestamp
motion_capture_tracking_interfaces/LatencyInfo[] latencies
motion_capture_tracking_interfaces/NamedPose[] poses
{HEADER}{SEPARATOR}MSG: motion_capture_tracking_interfaces/LatencyInfo
string source
uint32 latency
{NAMED_POSE}""",
    "vicon_receiver/Position": f"std_msgs/Header header\n{POSITION}{HEADER}",
    "foxglove_msgs/PoseInFrame": f"""builtin_interfaces/Time timestamp
string frame_id
geometry_msgs/Pose pose
{POSE}""",
    "foxglove_msgs/PosesInFrame": f"""builtin_interfaces/Time timestamp
string frame_id
geometry_msgs/Pose[] poses
{POSE}""",
    "foxglove_msgs/FrameTransform": FRAME_TRANSFORM,
    "foxglove_msgs/FrameTransforms": f"""foxglove_msgs/FrameTransform[] transforms
{SEPARATOR}MSG: foxglove_msgs/FrameTransform
{FRAME_TRANSFORM}""",
    "geometry_msgs/PoseStamped": f"""std_msgs/Header header
geometry_msgs/Pose pose
{HEADER}{POSE}""",
    "geometry_msgs/PoseArray": f"""std_msgs/Header header
geometry_msgs/Pose[] poses
{HEADER}{POSE}""",
    "geometry_msgs/TransformStamped": TRANSFORM_STAMPED,
    "tf2_msgs/TFMessage": f"""geometry_msgs/TransformStamped[] transforms
{SEPARATOR}MSG: geometry_msgs/TransformStamped
{TRANSFORM_STAMPED}""",
    "std_msgs/Float64MultiArray": LAYOUT.format(kind="float64"),
    "std_msgs/Float32MultiArray": LAYOUT.format(kind="float32"),
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/Float32": "float32 data\n",
}
# what it was in versions before
BEFORE = {
    "vicon_receiver/Position": POSITION,
    "mocap4r2_msgs/Markers": OLDER_MARKERS,
    "mocap_msgs/Markers": OLDER_MARKERS,
}
