from glob import glob

from setuptools import setup

NAME = 'optopad_ros'

setup(
    name=NAME,
    version='0.2.0',
    packages=[NAME],
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        ('share/' + NAME + '/launch', glob('launch/*.launch.py')),
        ('share/' + NAME + '/config', glob('config/*.yaml')),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='optopad',
    maintainer_email='optopad@localhost.localdomain',
    description="Publishes frames and touches of optopad's optical touch pads.",
    license='MIT',
    entry_points={'console_scripts': ['sensor = optopad_ros.sensor_node:main']},
)
