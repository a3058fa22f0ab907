//! Small files of formats that are text: STL, OFF, OBJ and XYZ.

/// Meshes, by name.
pub const MESHES: [(&str, &str); 12] = [
    (
        "a.stl",
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a",
    ),
    (
        "several.stl",
        " SOLID one\r\n FACET NORMAL 0 0 0\r\n  OUTER LOOP\r\n   VERTEX -1e-1 .5 +0\r\n   VERTEX 1 0 0\r\n   VERTEX 0 1 -0\r\n  \
         ENDLOOP\r\n ENDFACET\r\nENDSOLID\r\n\r\nsolid two words\nfacet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\n\
         vertex 0 0 1\nendloop\nendfacet\nendsolid two words\n",
    ),
    ("a.off", "COFF\n4 1 0\n0 0 0 1 1 1 1\n2 0 0\n2 2 0\n1 .5 0\n4 0 1 2 3"),
    (
        "plain.off",
        "# by hand\n\nOFF 4 4 6 # counts\n0 0 0\n1 0 0\n0 1 0 # up\n0 0 1\n3 0 2 1\n3 0 1 3 255 0 0\n3 0 3 2\n3 1 2 3 .5\n",
    ),
    (
        "normals.off",
        "STCNOFF\r\n3 1\r\n0 0 0 0 0 1 1 1 1 1 0 0\r\n1 0 0 0 0 1 1 1 1 1 1 0\r\n0 1 0 0 0 1 1 1 1 1 0 1\r\n3 0 1 2\r\n",
    ),
    ("polygon.off", "OFF\n6 2 0\n0 0 0\n2 0 0\n3 1 0\n2 2 0\n1 .5 0\n0 2 0\n6 0 1 2 3 4 5\n2 0 1\n"),
    ("a.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 .5 0\nf 1/1 -3 3//3 4"),
    (
        "normals.obj",
        "# by a program\nmtllib a.mtl\no a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nusemtl m\ns off\nf 1//1 2//1 3//1\nf 1/1/1 3/1/1 \
         2/1/1\n",
    ),
    ("backwards.obj", "v 0 0 0 1\r\nv 1 0 0 .5\r\nv 0 1 0\r\nf -3 -2 -1\r\nv 0 0 1\r\nf -1/-1/-1 -2 -3\r\n"),
    (
        "colours.obj",
        "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1 # white\ng all\nf 1 2 3 4\nl 1 2\np 1\n",
    ),
    ("continued.obj", "v 0 0 \\\n0\nv 1 \\\n \\\n0 0\nv 0 1e0 0\nf 1 2 \\\n3\n"),
    ("polygon.obj", "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 1 .5 0\nv 0 2 0\nf 1 2 3 4 5 6\nf 1 2\nf 1 1 2\n"),
];

/// XYZ: the points `(1, 2, 3)` and `(-0.4, 5, 6.5)` however they are separated, announced and commented.
pub const TWO_POINTS: [&str; 9] = [
    "1 2 3\n-4e-1 5 6.5",
    "1,2,3\r\n-.4, 5,\t6.5\r\n",
    "# made by a test\n\n1;2;3 // first\n-0.4;5;6.5 # second\n",
    "2\n1 2 3\n-0.4 5 6.5\n",
    "//X Y Z\n1 2 3 200\n-0.4 5 6.5 17\n",
    "1 2 3 255 0 0\n-0.4 5 6.5 0 0 0\n",
    "1 2 3 0.3 0.3 0.3\n-0.4 5 6.5 1 0 0\n",
    "Intensity;Z;y;X\n9;3;2;1\n9;6.5;5;-0.4\n",
    "\u{feff}1 2 3 4 5 6 7\n-0.4 5 6.5 4 5 6 7\n",
];

/// XYZ: `(1, 2, 3)` three times, with the normals x, none, and `(0.6, 0.8, 0)`.
pub const NORMALS: [&str; 3] = [
    "1 2 3 0.99 0 0\n1 2 3 0 0 0\n1 2 3 .6 .8 0\n",
    "nx ny nz x y z\n2 0 0 1 2 3\n0 0 0 1 2 3\n3 4 0 1 2 3\n",
    "x y z i normal_x normal_y normal_z\n1 2 3 9 2 0 0\n1 2 3 9 0 0 0\n1 2 3 9 3 4 0\n",
];
