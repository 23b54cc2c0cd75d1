// Mean curvature flow skeleton of an OFF mesh by CGAL: `cgal_skeleton MESH.off OUT.json` prints the seconds of the extraction alone.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/extract_mean_curvature_flow_skeleton.h>
#include <chrono>
#include <fstream>
#include <iostream>

using Mesh = CGAL::Surface_mesh<CGAL::Simple_cartesian<double>::Point_3>;
using Skeletonization = CGAL::Mean_curvature_flow_skeletonization<Mesh>;

int main(int argc, char** argv) {
    if (argc != 3) { std::cerr << "cgal_skeleton MESH.off OUT.json\n"; return 2; }
    Mesh mesh;
    std::ifstream(argv[1]) >> mesh;
    const auto start = std::chrono::steady_clock::now();
    Skeletonization::Skeleton skeleton;
    CGAL::extract_mean_curvature_flow_skeleton(mesh, skeleton);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    std::ofstream out(argv[2]);
    out.precision(17);
    out << "{\"points\": [";
    const char* comma = "";
    for (auto v : CGAL::make_range(vertices(skeleton))) {
        const auto& p = skeleton[v].point;
        out << comma << "[" << p.x() << ", " << p.y() << ", " << p.z() << "]";
        comma = ", ";
    }
    out << "], \"edges\": [";
    comma = "";
    for (auto e : CGAL::make_range(edges(skeleton))) {
        out << comma << "[" << source(e, skeleton) << ", " << target(e, skeleton) << "]";
        comma = ", ";
    }
    out << "]}\n";
    std::cout << "{\"triangles\": " << mesh.number_of_faces() << ", \"seconds\": " << seconds.count() << "}\n";
}
