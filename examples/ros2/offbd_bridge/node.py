"""The node: subscribes to the rig, publishes on /diagnostics. The work is done in bridge.py."""

import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from offbd import Client, ClientError
from offbd_bridge.bridge import Bridge

# The client tries for so long before the node reports that the service is away, s.
PATIENCE_S = 10.0
# Pause after an answer that may change, such as that of an asset that is missing, s.
RETRY_S = 1.0
DIAGNOSTICS_PERIOD_S = 1.0


class OffbdNode(Node):
    def __init__(self):
        super().__init__("offbd_bridge")
        text = {
            name: self.declare_parameter(name, default).value
            for name, default in [
                ("url", "http://127.0.0.1:8087"),
                ("asset", "rig"),
                ("session", ""),
                ("token_file", ""),
                ("qx_joint", "qx"),
                ("qy_joint", "qy"),
            ]
        }
        self.joints = (text["qx_joint"], text["qy_joint"])
        token = open(text["token_file"]).read().strip() if text["token_file"] else None
        session = text["session"] or f"ros-{self.get_clock().now().nanoseconds // 10**9}"
        client = Client(text["url"], token=token, patience_s=PATIENCE_S)
        self.bridge = Bridge(client, text["asset"], session)
        # The faults are asked for in another thread, so that a lost network delays neither the
        # samples nor the executor.
        self.reader = Bridge(
            Client(text["url"], token=token, patience_s=0.0), text["asset"], session
        )
        self.create_subscription(JointState, "command", self.on_command, qos_profile_sensor_data)
        self.create_subscription(PointStamped, "ball", self.on_ball, qos_profile_sensor_data)
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTICS_PERIOD_S, self.publish)
        threading.Thread(target=self.send, daemon=True).start()
        threading.Thread(target=self.read, daemon=True).start()

    def on_command(self, message):
        angles = dict(zip(message.name, message.position, strict=False))
        if all(joint in angles for joint in self.joints):
            self.bridge.command(*(angles[joint] for joint in self.joints))

    def on_ball(self, message):
        stamp = message.header.stamp
        seen = [value if value == value else None for value in (message.point.x, message.point.y)]
        self.bridge.position(stamp.sec + stamp.nanosec * 1e-9, *seen)

    def send(self):
        while rclpy.ok():
            if self.bridge.wait(timeout_s=1.0):
                try:
                    self.bridge.deliver()
                except ClientError as error:
                    self.get_logger().warning(str(error), throttle_duration_sec=10.0)
                    if error.status is not None and not error.is_final:
                        time.sleep(RETRY_S)

    def read(self):
        while rclpy.ok():
            self.reader.refresh()
            time.sleep(DIAGNOSTICS_PERIOD_S)

    def publish(self):
        array = DiagnosticArray()
        array.header.stamp = self.get_clock().now().to_msg()
        for level, name, text, values in self.reader.diagnoses():
            status = DiagnosticStatus(
                level=bytes([level]), name=name, message=text, hardware_id=self.bridge.asset
            )
            status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
            array.status.append(status)
        self.diagnostics.publish(array)


def main():
    rclpy.init()
    node = OffbdNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
