//! What must be seen: areas, order in depth, colours, and the same bytes from any number of threads.

use std::f64::consts::PI;
use topipe_mesh::{DVec3, TriangleMesh};
use topipe_render::{
    Camera, Color, Coloring, EdgeOverlay, Image, LineLayer, LineWidth, MeshLayer, Options, RenderError,
    Scene, Shading, render, render_views,
};

const RED: Color = Color([200, 30, 30]);
const BLUE: Color = Color([30, 30, 200]);

/// A square of side 2 at height `z`, counter-clockwise from above.
fn square(z: f64) -> TriangleMesh {
    let corners = vec![[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
    TriangleMesh::from_arrays(corners, vec![[0, 1, 2], [0, 2, 3]])
}

fn sphere(rings: u32, sectors: u32) -> TriangleMesh {
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for i in 1..rings {
        let (s, c) = (PI * f64::from(i) / f64::from(rings)).sin_cos();
        for j in 0..sectors {
            let (y, x) = (2.0 * PI * f64::from(j) / f64::from(sectors)).sin_cos();
            positions.push([s * x, s * y, c]);
        }
    }
    let at = |i: u32, j: u32| 2 + (i - 1) * sectors + j % sectors;
    let mut triangles = Vec::new();
    for j in 0..sectors {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([1, at(rings - 1, j + 1), at(rings - 1, j)]);
        for i in 1..rings - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriangleMesh::from_arrays(positions, triangles)
}

fn plain(size: usize) -> Options {
    Options { width: size, height: size, supersampling: 1, occlusion: 0.0, margin: 0.1, ..Options::default() }
}

fn picture(mesh: &TriangleMesh, camera: Camera, options: &Options) -> Image {
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer::new(mesh));
    render(&scene, &camera, options).unwrap()
}

fn covered(image: &Image) -> usize {
    image.pixels().iter().filter(|&&p| p != Color::WHITE).count()
}

fn redder(color: Color) -> bool {
    color.0[0] > color.0[2]
}

#[test]
fn a_square_covers_exactly_its_pixels() {
    // The square takes 80 % of 100 pixels each way.
    let image = picture(&square(0.0), Camera::TOP, &plain(100));
    assert_eq!(covered(&image), 80 * 80);
    assert_eq!(image.pixel(9, 50), Some(Color::WHITE));
    assert_ne!(image.pixel(10, 50), Some(Color::WHITE));
    // Shared edges leave no gap, and faces seen edge on are not seen at all.
    assert_eq!(covered(&picture(&square(0.0), Camera::FRONT, &plain(100))), 0);
}

#[test]
fn a_sphere_covers_a_disk_and_is_brightest_towards_the_light() {
    let image = picture(&sphere(60, 120), Camera::ISO, &plain(200));
    let disk = PI * 80.0 * 80.0;
    assert!((covered(&image) as f64 / disk - 1.0).abs() < 0.01, "{} of {disk}", covered(&image));
    let sum = |x, y| image.pixel(x, y).unwrap().0.iter().map(|&c| u32::from(c)).sum::<u32>();
    assert!(sum(70, 60) > sum(130, 140), "upper left against lower right");
}

#[test]
fn the_nearer_surface_hides_the_other_in_any_order() {
    let (near, far) = (square(1.0), square(0.0));
    let colored = |mesh, color| MeshLayer { coloring: Coloring::Uniform(color), ..MeshLayer::new(mesh) };
    for near_first in [true, false] {
        let mut scene = Scene::default();
        if near_first {
            scene.add_mesh(colored(&near, RED)).add_mesh(colored(&far, BLUE));
        } else {
            scene.add_mesh(colored(&far, BLUE)).add_mesh(colored(&near, RED));
        }
        let image = render(&scene, &Camera::TOP, &plain(40)).unwrap();
        assert!(redder(image.pixel(20, 20).unwrap()));
    }
}

#[test]
fn faces_seen_from_behind_are_tinted() {
    let green = Coloring::Uniform(Color([40, 180, 60]));
    let mesh = square(0.0);
    for (camera, warned) in [(Camera::TOP, false), (Camera::BOTTOM, true)] {
        for warn_back_faces in [false, true] {
            let mut scene = Scene::default();
            scene.add_mesh(MeshLayer { coloring: green.clone(), warn_back_faces, ..MeshLayer::new(&mesh) });
            let Color([r, g, _]) = render(&scene, &camera, &plain(20)).unwrap().pixel(10, 10).unwrap();
            assert_eq!(r > g, warned && warn_back_faces);
        }
    }
}

#[test]
fn what_is_behind_a_translucent_surface_shines_through() {
    let (glass, body) = (square(1.0), square(0.0));
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer { coloring: Coloring::Uniform(BLUE), opacity: 0.3, ..MeshLayer::new(&glass) });
    scene.add_mesh(MeshLayer { coloring: Coloring::Uniform(RED), ..MeshLayer::new(&body) });
    let through = render(&scene, &Camera::TOP, &plain(20)).unwrap().pixel(10, 10).unwrap();
    let alone = |mesh, color| {
        let mut scene = Scene::default();
        scene.add_mesh(MeshLayer { coloring: Coloring::Uniform(color), ..MeshLayer::new(mesh) });
        render(&scene, &Camera::TOP, &plain(20)).unwrap().pixel(10, 10).unwrap()
    };
    let (red, blue) = (alone(&body, RED), alone(&glass, BLUE));
    assert!(through.0[0] < red.0[0] && through.0[0] > blue.0[0]);
    assert!(through.0[2] > red.0[2] && through.0[2] < blue.0[2]);
}

#[test]
fn a_line_on_a_surface_is_seen_over_its_full_width_and_behind_it_not_at_all() {
    let mesh = square(0.0);
    for (z, columns) in [(0.0, 4), (-1.0, 0)] {
        let mut scene = Scene::default();
        scene.add_mesh(MeshLayer::new(&mesh));
        scene.add_lines(LineLayer {
            polylines: vec![vec![DVec3::new(0.0, -0.9, z), DVec3::new(0.0, 0.9, z)]],
            coloring: Coloring::Uniform(RED),
            width: LineWidth::Pixels(4.0),
        });
        let image = render(&scene, &Camera::TOP, &plain(100)).unwrap();
        let seen = (0..100).filter(|&x| image.pixel(x, 50) == Some(RED)).count();
        assert_eq!(seen, columns, "at height {z}");
    }
}

#[test]
fn a_tube_is_as_wide_as_its_radius_says() {
    let mut scene = Scene::default();
    scene.add_lines(LineLayer {
        polylines: vec![vec![DVec3::new(-4.0, 0.0, 0.0), DVec3::new(4.0, 0.0, 0.0)], vec![DVec3::ZERO]],
        coloring: Coloring::PerElement(vec![RED, BLUE]),
        width: LineWidth::Tube(0.5),
    });
    let image = render(&scene, &Camera::TOP, &plain(100)).unwrap();
    // 8 mm take 80 pixels.
    let rows = (0..100).filter(|&y| image.pixel(30, y) != Some(Color::WHITE)).count();
    assert_eq!(rows, 10);
}

#[test]
fn a_corner_is_darker_with_occlusion_and_open_ground_is_not() {
    let mut mesh = square(0.0);
    let wall = TriangleMesh::from_arrays(
        vec![[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let offset = mesh.vertex_count() as u32;
    mesh.positions.extend(&wall.positions);
    mesh.triangles.extend(wall.triangles.iter().map(|t| t.map(|v| topipe_mesh::VertexId(v.0 + offset))));
    let camera = Camera::new(-90.0, 80.0);
    let bright = picture(&mesh, camera, &plain(200));
    let dark = picture(&mesh, camera, &Options { occlusion: 1.0, ..plain(200) });
    let level = |image: &Image, y| u32::from(image.pixel(100, y).unwrap().0[1]);
    assert_eq!(level(&dark, 170), level(&bright, 170), "far from the wall");
    // The wall stands across the middle of the picture: the deepest shadow lies along its foot.
    let foot = (10..190).max_by_key(|&y| level(&bright, y) - level(&dark, y)).unwrap();
    let shadow = level(&bright, foot) - level(&dark, foot);
    assert!((85..115).contains(&foot) && shadow > 15, "a shadow of {shadow} in row {foot}");
}

#[test]
fn edges_are_drawn_where_triangles_meet() {
    let mesh = square(0.0);
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer {
        edges: Some(EdgeOverlay { color: Color::BLACK, width: 2.0 }),
        ..MeshLayer::new(&mesh)
    });
    let image = render(&scene, &Camera::TOP, &plain(100)).unwrap();
    let (diagonal, inside) = (image.pixel(50, 50).unwrap(), image.pixel(30, 50).unwrap());
    assert!(diagonal.0[1] < inside.0[1]);
}

#[test]
fn any_number_of_threads_makes_the_same_bytes() {
    let mesh = sphere(24, 48);
    let ids: Vec<u32> = mesh.faces().map(|f| f.0 / 7).collect();
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer {
        coloring: Coloring::PerElement(topipe_render::palette::categorical_faces(&mesh, &ids)),
        ..MeshLayer::new(&mesh)
    });
    let options = Options { width: 150, height: 130, supersampling: 2, ..Options::default() };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let views = [Camera::ISO, Camera::FRONT, Camera::TOP];
        pool.install(|| render_views(&scene, &views, 2, &options).unwrap().encode_png().unwrap())
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(7));
}

#[test]
fn broken_input_is_refused_or_left_out() {
    let mut mesh = square(0.0);
    let mut scene = Scene::default();
    scene.add_mesh(MeshLayer { coloring: Coloring::PerElement(vec![RED]), ..MeshLayer::new(&mesh) });
    let refused = render(&scene, &Camera::TOP, &plain(10));
    assert!(matches!(refused, Err(RenderError::ColorCount { layer: 0, colors: 1, elements: 2, .. })));
    let refused = render(&Scene::default(), &Camera::TOP, &plain(0));
    assert!(matches!(refused, Err(RenderError::Size { .. })));
    assert_eq!(covered(&render(&Scene::default(), &Camera::TOP, &plain(10)).unwrap()), 0);

    mesh.positions[3].x = f64::NAN;
    mesh.triangles.push([0, 1, 99].map(topipe_mesh::VertexId));
    for shading in [Shading::Flat, Shading::Smooth { crease: 30.0 }] {
        let mut scene = Scene::default();
        scene.add_mesh(MeshLayer { shading, ..MeshLayer::new(&mesh) });
        let image = render(&scene, &Camera::TOP, &plain(100)).unwrap();
        assert!((covered(&image) as i64 - 80 * 80 / 2).abs() <= 80, "half of the square is left");
    }
}

#[test]
fn a_scale_bar_is_as_long_as_it_says() {
    // The square is 2 mm wide and fills 80 of 100 pixels: 40 pixels a millimetre, so a bar of 0.2 mm has 8.
    let options = Options { scale_bar: true, ..plain(100) };
    let bare = picture(&square(0.0), Camera::TOP, &plain(100));
    let with = picture(&square(0.0), Camera::TOP, &options);
    let row = 100 - 8 - 1;
    let length = (0..100).filter(|&x| with.pixel(x, row) == Some(Color::LINE)).count();
    assert_eq!(length, 8, "0.5 mm would be more than a sixth of the picture");
    assert!(with.pixels().iter().zip(bare.pixels()).filter(|(a, b)| a != b).count() > 40);
}
