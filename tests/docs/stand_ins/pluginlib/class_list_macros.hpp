#pragma once

#define PLUGINLIB_EXPORT_CLASS(own, base) \
  base* made() { return new own; }
