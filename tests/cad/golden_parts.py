"""Recorded parts of every preset: volume of the solid [mm3], size of the file [mm], holes right through.

Changed on purpose only: each row stands for what somebody printed. Holes are handles of the surface (its genus, from
Euler's V - E + F = 2 - 2 g): the fixing holes, and two lead holes for each radial part.
"""

Record = tuple[float, tuple[float, float, float], int]

RECORDED: dict[str, dict[str, Record]] = {
    "piacenza2017-pad": {
        "mold": (13547.953, (45.0, 45.0, 13.5), 20),
        "leveling_blade": (2452.100, (45.0, 21.5, 3.0), 0),
        "pour_gauge": (1107.000, (45.0, 9.8, 3.0), 0),
        "solder_jig": (1543.152, (18.9, 16.8, 5.0), 2),
        "indenter_tip": (763.407, (6.0, 5.998, 28.0), 0),
    },
    "piacenza2017-pair": {
        "mold": (9028.351, (33.0, 33.0, 13.5), 10),
        "leveling_blade": (1702.100, (33.0, 21.5, 3.0), 0),
        "pour_gauge": (819.000, (33.0, 9.8, 3.0), 0),
        "solder_jig": (1543.152, (18.9, 16.8, 5.0), 2),
        "indenter_tip": (763.407, (6.0, 5.998, 28.0), 0),
    },
    "oblong-60x40": {
        "mold": (22698.487, (73.0, 53.0, 13.5), 28),
        "leveling_blade": (2952.100, (53.0, 21.5, 3.0), 0),
        "pour_gauge": (1299.000, (53.0, 9.8, 3.0), 0),
        "solder_jig": (1543.152, (18.9, 16.8, 5.0), 2),
        "indenter_tip": (763.407, (6.0, 5.998, 28.0), 0),
    },
    "fingertip-16": {
        "mold": (3680.496, (26.0, 26.0, 9.5), 4),
        "leveling_blade": (1205.500, (26.0, 18.5, 3.0), 0),
        "pour_gauge": (651.000, (26.0, 9.8, 3.0), 0),
        "solder_jig": (1189.195, (15.475, 16.0, 5.0), 0),
        "indenter_tip": (308.295, (4.0, 3.999, 25.2), 0),
    },
}
