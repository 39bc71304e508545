// A block of steel with a step, and a cube of rubber on it. gmsh -3 part.geo -format msh41 -o part.msh
SetFactory("OpenCASCADE");
Box(1) = {1, 1, 1, 2, 1, 0.5};
Cylinder(2) = {1.4, 1, 1.25, 0, 1, 0, 0.15};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Box(4) = {2.1, 1, 1.5, 0.9, 1, 0.7};
BooleanFragments{ Volume{3}; Delete; }{ Volume{4}; Delete; }
Physical Volume("steel") = {3};
Physical Volume("rubber") = {4};
Physical Surface("foot") = Surface In BoundingBox {0.9, 0.9, 0.9, 3.1, 2.1, 1.1};
Physical Surface("hole") = Surface In BoundingBox {1.2, 0.9, 1.05, 1.6, 2.1, 1.45};
Physical Surface("top of steel") = Surface In BoundingBox {0.9, 0.9, 1.4, 2.2, 2.1, 1.6};
Mesh.MeshSizeMax = 0.7;
