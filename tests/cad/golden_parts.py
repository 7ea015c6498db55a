"""Recorded parts of every preset: volume of the solid [mm3], size of the file [mm], holes right through.

Changed on purpose only: each row stands for what somebody printed. Holes are handles of the surface (its genus, from
Euler's V - E + F = 2 - 2 g): the fixing holes, two lead holes for each radial part, and the four through which a
crowned pad is filled.
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
    "levi2013-disc": {
        "mold": (26895.863, (72.000, 72.000, 13.500), 20),
        "leveling_blade": (4024.354, (72.000, 21.500, 3.000), 0),
        "pour_gauge": (1755.000, (72.000, 9.800, 3.000), 0),
        "solder_jig": (1559.952, (19.100, 16.800, 5.000), 2),
        "indenter_tip": (763.407, (6.000, 5.998, 28.000), 0),
    },
    "crowned-40x25": {
        "mold": (12537.355, (52.000, 37.000, 12.000), 8),
        "lid": (6223.199, (52.000, 37.000, 5.995), 0),
        "solder_jig": (1189.195, (15.475, 16.000, 5.000), 0),
        "indenter_tip": (735.133, (6.000, 5.998, 27.000), 0),
    },
    "fingertip-dome": {
        "mold": (5770.659, (36.000, 36.000, 8.321), 8),
        "lid": (5582.240, (36.000, 36.000, 9.179), 0),
        "solder_jig": (1189.195, (15.475, 16.000, 5.000), 0),
        "indenter_tip": (305.782, (4.000, 3.999, 25.000), 0),
    },
    "gripper-stadium": {
        "mold": (3913.312, (34.0, 24.0, 9.5), 4),
        "leveling_blade": (1087.092, (24.0, 18.5, 3.0), 0),
        "pour_gauge": (603.0, (24.0, 9.8, 3.0), 0),
        "solder_jig": (1189.195, (15.475, 16.0, 5.0), 0),
        "indenter_tip": (166.112, (3.0, 2.999, 24.0), 0),
    },
}
