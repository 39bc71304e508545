// A plate of 2 × 1 with a round hole, and a square insert beside it. gmsh -2 plate.geo -format msh41 -o plate.msh
SetFactory("OpenCASCADE");
Rectangle(1) = {1, 1, 0, 2, 1};
Disk(2) = {1.7, 1.45, 0, 0.25};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Rectangle(4) = {3, 1, 0, 0.75, 1};
BooleanFragments{ Surface{3}; Delete; }{ Surface{4}; Delete; }
Physical Surface("steel") = {3};
Physical Surface("rubber") = {4};
Physical Curve("left") = Curve In BoundingBox {0.9, 0.9, -1, 1.1, 2.1, 1};
Physical Curve("hole") = Curve In BoundingBox {1.4, 1.1, -1, 2.0, 1.8, 1};
Physical Curve("top of rubber") = Curve In BoundingBox {2.9, 1.9, -1, 4, 2.1, 1};
Mesh.MeshSizeMax = 0.25;
