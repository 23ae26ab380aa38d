// The offbd library: samples go into a ring, an uplink sends them until the service has
// acknowledged that they are stored. See README.md and examples/.
#pragma once

#include "offbd/http.h"
#include "offbd/mqtt.h"
#include "offbd/ring.h"
#include "offbd/uplink.h"

#ifdef ARDUINO
#include "offbd/arduino.h"
#endif
