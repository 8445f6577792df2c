//! Surfaces as they come from scans, exporters and modelling programs: open, doubled, turned, crossing,
//! degenerate, in other units. Each is mended with a note and can be filled, or refused by name with a remedy.

#[allow(dead_code)] // One shape of several is asked for.
#[path = "support/surfaces.rs"]
mod surfaces;

use glam::Vec3;
use palpate::geom::SurfaceMesh;
use palpate::geom::import::{ImportOptions, read_surface_bytes};
use palpate::geom::lattice::{Lattice, cells_for};
use std::fmt::Write;
use std::path::Path;

/// Points and triangles.
#[derive(Clone)]
struct Soup {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// A ball of 5 cm, of 24 meridians and 15 parallels.
fn ball() -> Soup {
    let mesh: SurfaceMesh = surfaces::sphere(0.05, 24, 15);
    Soup {
        triangles: mesh.point_triangles(),
        points: mesh.points,
    }
}

impl Soup {
    /// The triangles whose middle is wanted.
    fn kept(mut self, wanted: impl Fn(Vec3) -> bool) -> Self {
        let points = &self.points;
        let middle = |t: &[u32; 3]| t.map(|p| points[p as usize]).iter().sum::<Vec3>() / 3.0;
        self.triangles.retain(|t| wanted(middle(t)));
        self
    }

    fn moved(mut self, change: impl Fn(Vec3) -> Vec3) -> Self {
        self.points.iter_mut().for_each(|p| *p = change(*p));
        self
    }

    /// The first so many triangles turned over, every `step`th of them.
    fn turned(mut self, step: usize) -> Self {
        let turned = self.triangles.iter_mut().step_by(step);
        turned.for_each(|t| t.swap(1, 2));
        self
    }

    fn and(mut self, other: &Self) -> Self {
        let first = self.points.len() as u32;
        self.points.extend(&other.points);
        let triangles = other.triangles.iter();
        self.triangles
            .extend(triangles.map(|t| t.map(|p| first + p)));
        self
    }

    /// The first `count` triangles once more.
    fn repeated(mut self, count: usize) -> Self {
        self.triangles.extend_from_within(..count);
        self
    }

    /// A triangle cut in two at one edge, its neighbour not.
    fn with_t_junction(mut self) -> Self {
        let [a, b, c] = self.triangles[200];
        let middle = self.points.len() as u32;
        let [p, q] = [a, b].map(|p| self.points[p as usize]);
        self.points.push((p + q) / 2.0);
        self.triangles[200] = [a, middle, c];
        self.triangles.push([middle, b, c]);
        self
    }

    fn with(mut self, triangles: &[[u32; 3]]) -> Self {
        self.triangles.extend(triangles);
        self
    }

    fn obj(&self) -> String {
        let mut text = String::new();
        for p in &self.points {
            writeln!(text, "v {} {} {}", p.x, p.y, p.z).expect("a string takes it");
        }
        for [a, b, c] in &self.triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("a string takes it");
        }
        text
    }
}

/// Volume [mL] and notes, or the message of the refusal. What is taken has a lattice.
fn taken(text: &str) -> Result<(f64, String), String> {
    let file = Path::new("nasty.obj");
    let surface = read_surface_bytes(file, text.as_bytes(), &ImportOptions::default())
        .map_err(|error| error.to_string())?;
    let mesh = &surface.mesh;
    let lattice = Lattice::around(mesh, cells_for(mesh).cell_m, 1000.0)
        .map_err(|error| format!("no lattice: {error}"))?;
    let weights = lattice.embedding.weights.iter().flatten();
    assert!(weights.chain(&lattice.masses_kg).all(|w| w.is_finite()));
    // None of these has texture coordinates.
    let notes = surface.notes.into_iter();
    let notes: Vec<String> = notes.filter(|note| !note.contains("texture")).collect();
    Ok((1e6 * mesh.volume_m3(), notes.join("; ")))
}

/// Volume of [`ball`] [mL].
const BALL_ML: f64 = 511.0;

#[test]
fn surfaces_with_small_faults_are_mended_with_a_note() {
    let beside = ball().moved(|p| 0.6 * p + Vec3::X * 0.2);
    let crossing = ball().moved(|p| 0.6 * p + Vec3::X * 0.04);
    let inner = ball().moved(|p| 0.6 * p).turned(1);
    let fin = [[60, 61, 361]];
    let faults: [(&str, Soup, f64, &str); 15] = [
        ("sound", ball(), 1.0, ""),
        (
            "all turned",
            ball().turned(1),
            1.0,
            "turned to face outwards",
        ),
        (
            "some turned",
            ball().turned(7),
            1.0,
            "turned to face outwards",
        ),
        ("doubled", ball().repeated(100), 1.0, "repeat another"),
        (
            "flat triangles",
            ball().with(&[[5, 5, 6], [7, 7, 7]]),
            1.0,
            "degenerate",
        ),
        (
            "small hole",
            ball().kept(|p| p.y < 0.049),
            1.0,
            "small holes closed",
        ),
        (
            "two small holes",
            ball().kept(|p| p.y.abs() < 0.049),
            1.0,
            "2 small holes closed",
        ),
        (
            "half of it",
            ball().kept(|p| p.y < 0.0),
            0.5,
            "1 openings closed by lids",
        ),
        (
            "its ends cut off",
            ball().kept(|p| p.y.abs() < 0.035),
            0.89,
            "2 openings closed by lids",
        ),
        (
            "a triangle away",
            ball().kept(|p| p.distance(Vec3::X * 0.05) > 0.007),
            1.0,
            "closed",
        ),
        ("T-junction", ball().with_t_junction(), 1.0, "closed"),
        (
            "fin",
            ball().with(&fin),
            1.0,
            "more than two met at an edge",
        ),
        ("two parts", ball().and(&beside), 1.0, "left out"),
        ("parts that cross", ball().and(&crossing), 1.0, "left out"),
        ("a cavity", ball().and(&inner), 1.0, "left out"),
    ];
    for (name, soup, share, said) in faults {
        let (volume_ml, notes) = taken(&soup.obj()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let expected = share * BALL_ML;
        assert!(
            (volume_ml / expected - 1.0).abs() < 0.02,
            "{name}: {volume_ml} mL"
        );
        assert!(notes.contains(said), "{name}: {notes}");
        assert_eq!(notes.is_empty(), said.is_empty(), "{name}: {notes}");
    }
}

#[test]
fn surfaces_that_are_no_body_are_refused_with_a_remedy() {
    let far = |scale: f32| ball().moved(|p| scale * p);
    let refused: [(&str, Soup, &str); 8] = [
        (
            "a sheet that is bent",
            ball().kept(|p| p.y > 0.03),
            "fill the holes",
        ),
        (
            "a tube",
            ball().kept(|p| p.y.abs() < 0.02),
            "fill the holes",
        ),
        (
            "a triangle",
            ball().kept(|p| p.distance(Vec3::X * 0.05) < 0.006),
            "fill the holes",
        ),
        ("nothing", ball().kept(|_| false), "triangles"),
        (
            "a sheet",
            ball().moved(|p| Vec3::new(p.x, 0.0, p.z)),
            "fill the holes",
        ),
        ("far away", far(1e12), "vertex 0"),
        ("not finite", far(f32::INFINITY), "vertex 0"),
        ("no size", far(0.0), "thickness"),
    ];
    for (name, soup, said) in refused {
        let message = taken(&soup.obj()).expect_err(name);
        assert!(message.contains(said), "{name}: {message}");
        assert!(message.contains("nasty.obj"), "{name}: {message}");
    }
}

#[test]
fn bodies_of_any_unit_far_from_the_origin_or_thin_are_filled() {
    let bodies: [(&str, Soup); 6] = [
        ("millimetres", ball().moved(|p| 1000.0 * p)),
        ("a micrometre long", ball().moved(|p| 1e-5 * p)),
        ("at 100 m", ball().moved(|p| p + 100.0)),
        ("a pancake", ball().moved(|p| p * Vec3::new(1.0, 0.01, 1.0))),
        ("a needle", ball().moved(|p| p * Vec3::new(0.01, 3.0, 0.01))),
        ("mirrored", ball().moved(|p| -p)),
    ];
    for (name, soup) in bodies {
        let (volume_ml, _) = taken(&soup.obj()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(volume_ml > 0.0, "{name}");
    }
}

#[test]
fn what_writers_of_obj_do_is_read() {
    let text = ball().obj();
    let sound = taken(&text);
    let (first, last) = text.trim_end().rsplit_once(' ').expect("it ends in a face");
    let weighted = |line: &str| match line.starts_with('v') {
        true => format!("{line} 1.0 0.5 0.5\n"),
        false => format!("{line}\n"),
    };
    let others = [
        ("CRLF", text.replace('\n', "\r\n")),
        ("a mark of byte order", format!("\u{feff}{text}")),
        ("a joined line", format!("{first} \\\n {last}\n")),
        ("weights and colours", text.lines().map(weighted).collect()),
        ("no new line at the end", text.trim_end().to_owned()),
        (
            "comments and unknown words",
            format!("# made by hand\nvp 0 1\ns off\n{text}"),
        ),
    ];
    for (name, text) in others {
        assert_eq!(taken(&text), sound, "{name}");
    }
    let message = taken("v 0,5 0,5 0,5\n").expect_err("a comma is no point");
    assert!(
        message.contains("line 1") && message.contains("0,5"),
        "{message}"
    );
}
