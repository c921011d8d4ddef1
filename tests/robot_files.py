"""Robots as their files describe them."""

ARM = """\
<robot name="an arm">
  <link name="world"/>
  <link name="post"><inertial><mass value="3"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="upper">
    <inertial>
      <origin xyz="0.1 0.02 -0.03" rpy="0.3 -0.2 0.7"/>
      <mass value="2.5"/>
      <inertia ixx="0.03" ixy="0.001" ixz="-0.002" iyy="0.04" iyz="0.003" izz="0.05"/>
    </inertial>
  </link>
  <link name="1"><inertial><mass value="0.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial></link>
  <link name="slide"><inertial><origin xyz="0 0.1 0"/><mass value="0.7"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="finger"><inertial><mass value="0.2"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <joint name="stand" type="fixed"><parent link="world"/><child link="post"/><origin xyz="0 0 1"/></joint>
  <joint name="shoulder" type="revolute">
    <parent link="post"/><child link="upper"/><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/>
    <axis xyz="0 1 1"/><limit lower="-2" upper="1.5" velocity="3" effort="50"/>
    <dynamics damping="0.7" friction="1.3"/>
  </joint>
  <joint name="bracket" type="fixed"><parent link="upper"/><child link="1"/><origin xyz="0.4 0 0" rpy="0 1.2 0"/></joint>
  <joint name="j&quot;lift" type="prismatic">
    <parent link="1"/><child link="slide"/><origin xyz="0 0 0.1" rpy="-0.4 0 0"/>
    <axis xyz="0 0 -1"/><limit lower="0" upper="0.3" velocity="0.5" effort="100"/>
  </joint>
  <joint name="grip" type="continuous">
    <parent link="slide"/><child link="finger"/><origin xyz="0.05 0 0"/><axis xyz="0.6 0 0.8"/>
  </joint>
</robot>
"""

FOUR_BAR = """\
<robot name="four_bar">
  <link name="ground"/>
  <link name="crank"><inertial><origin xyz="0.2 0 0"/><mass value="1.2"/><inertia ixx="1e-4" iyy="0.016" izz="0.016"/></inertial></link>
  <link name="coupler"><inertial><origin xyz="0.45 0.02 0"/><mass value="2"/><inertia ixx="2e-4" iyy="0.135" izz="0.135"/></inertial></link>
  <link name="rocker"><inertial><origin xyz="0.35 0 0"/><mass value="1.6"/><inertia ixx="2e-4" iyy="0.065" izz="0.065"/></inertial></link>
  <link name="pin"/>
  <joint name="q_crank" type="continuous"><parent link="ground"/><child link="crank"/><axis xyz="0 1 0"/></joint>
  <joint name="q_coupler" type="continuous"><parent link="crank"/><child link="coupler"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="q_rocker" type="continuous"><parent link="ground"/><child link="rocker"/><origin xyz="1 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="q_pin" type="continuous"><parent link="coupler"/><child link="pin"/><origin xyz="0.9 0 0"/><axis xyz="0 1 0"/></joint>
</robot>
"""
