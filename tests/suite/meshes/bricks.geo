// A slanted block of eight hexahedra: of volume 0.42, with a lid of 0.7. gmsh -3 bricks.geo -format msh41 -bin -o bricks.msh
Point(1) = {1, 1, 1};
a[] = Extrude {0.9, 0.2, 0} { Point{1}; Layers{2}; };
b[] = Extrude {0.1, 0.8, 0} { Curve{1}; Layers{2}; Recombine; };
c[] = Extrude {0, 0.1, 0.6} { Surface{b[1]}; Layers{2}; Recombine; };
Physical Volume("bricks") = {c[1]};
Physical Surface("lid") = {c[0]};
