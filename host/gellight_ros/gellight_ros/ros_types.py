"""The types of ROS 2 that topics are made of and recordings are not: their names, definitions and hashes."""

from gellight.recording.ros_messages import DEFINITIONS as RECORDED
from gellight.recording.ros_messages import HEADER, IMAGE, definition

CAMERA_INFO, POINTS = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/PointCloud2"
POINT, WRENCH = "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/WrenchStamped"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TF = "tf2_msgs/msg/TFMessage"
MULTI_ARRAY = "std_msgs/msg/Float64MultiArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

DEFINITIONS = {
    **RECORDED,
    CAMERA_INFO: definition(
        HEADER + "uint32 height; uint32 width; string distortion_model; float64[] d; float64[9] k; float64[9] r; "
        "float64[12] p; uint32 binning_x; uint32 binning_y; sensor_msgs/RegionOfInterest roi",
        sensor_msgs_RegionOfInterest="uint32 x_offset; uint32 y_offset; uint32 height; uint32 width; bool do_rectify",
    ),
    POINTS: definition(
        HEADER + "uint32 height; uint32 width; sensor_msgs/PointField[] fields; bool is_bigendian; "
        "uint32 point_step; uint32 row_step; uint8[] data; bool is_dense",
        sensor_msgs_PointField="string name; uint32 offset; uint8 datatype; uint32 count",
    ),
    POINT: definition(HEADER + "geometry_msgs/Point point", geometry_msgs_Point="float64 x; float64 y; float64 z"),
    WRENCH: definition(
        HEADER + "geometry_msgs/Wrench wrench",
        geometry_msgs_Wrench="geometry_msgs/Vector3 force; geometry_msgs/Vector3 torque",
        geometry_msgs_Vector3="float64 x; float64 y; float64 z",
    ),
    POSE: definition(
        HEADER + "geometry_msgs/PoseWithCovariance pose",
        geometry_msgs_PoseWithCovariance="geometry_msgs/Pose pose; float64[36] covariance",
        geometry_msgs_Pose="geometry_msgs/Point position; geometry_msgs/Quaternion orientation",
        geometry_msgs_Point="float64 x; float64 y; float64 z",
        geometry_msgs_Quaternion="float64 x 0; float64 y 0; float64 z 0; float64 w 1",
    ),
    TF: definition(
        "geometry_msgs/TransformStamped[] transforms",
        geometry_msgs_TransformStamped=HEADER + "string child_frame_id; geometry_msgs/Transform transform",
        geometry_msgs_Transform="geometry_msgs/Vector3 translation; geometry_msgs/Quaternion rotation",
        geometry_msgs_Vector3="float64 x; float64 y; float64 z",
        geometry_msgs_Quaternion="float64 x 0; float64 y 0; float64 z 0; float64 w 1",
    ),
    MULTI_ARRAY: definition(
        "std_msgs/MultiArrayLayout layout; float64[] data",
        std_msgs_MultiArrayLayout="std_msgs/MultiArrayDimension[] dim; uint32 data_offset",
        std_msgs_MultiArrayDimension="string label; uint32 size; uint32 stride",
    ),
    DIAGNOSTICS: definition(
        HEADER + "diagnostic_msgs/DiagnosticStatus[] status",
        diagnostic_msgs_DiagnosticStatus="byte level; string name; string message; string hardware_id; "
        "diagnostic_msgs/KeyValue[] values",
        diagnostic_msgs_KeyValue="string key; string value",
    ),
}
"""of each type, those of a recording too, as ROS 2 writes them into a bag"""
HASHES = {
    IMAGE: "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    CAMERA_INFO: "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    POINTS: "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    POINT: "RIHS01_4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897",
    WRENCH: "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    POSE: "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    TF: "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    MULTI_ARRAY: "RIHS01_1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f",
    DIAGNOSTICS: "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
}
"""of the types that are topics (REP 2011), of Jazzy and later: who subscribes to another definition gets nothing"""
