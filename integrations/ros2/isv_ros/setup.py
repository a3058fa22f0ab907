"""Build of the ROS 2 package, by ament and setuptools."""

from setuptools import setup

setup(
    name="isv_ros",
    version="0.1.0",
    packages=["isv_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/isv_ros"]),
        ("share/isv_ros", ["package.xml"]),
    ],
    install_requires=["isv", "numpy", "setuptools"],
    entry_points={
        "console_scripts": ["send_cloud = isv_ros.nodes:send_cloud", "receive_cloud = isv_ros.nodes:receive_cloud"]
    },
)
