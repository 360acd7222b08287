"""The scenes that ship, some with changes that make their light easier to find.

Path tracing finds some of these lights once in thousands of samples or less: where it has to run
into a small light through glass or water, and where next-event estimation aims at lights behind
walls. Then a quick comparison would be one of luck, so it is made with a larger light or hole, all
else being equal.
"""

EASED: dict[str, dict[str, float | bool]] = {
    "cornell_box": {},
    "caustics": {"/World/Lights/Lamp.inputs:radius": 5.0},
    "door_ajar": {},
    "gallery": {},
    "pool": {"/World/Lights/Sun.inputs:angle": 20.0},
    "small_aperture": {"/World/Shutter/Left": False},  # a slit instead of a hole
    "snow_globe": {"/World/Lights/Lamp.inputs:radius": 6.0},
}
