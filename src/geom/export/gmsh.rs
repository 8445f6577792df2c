//! Tetrahedra as Gmsh files: the bytes depend on the mesh alone.

use crate::geom::TetMesh;
use std::fmt::Write;

/// `mesh` as an ASCII file of Gmsh's format 2.2: nodes [m] and tetrahedra, both numbered from 1.
///
/// Every f32 reads back as it was.
pub fn msh_bytes(mesh: &TetMesh) -> Vec<u8> {
    const TO_STRING: &str = "a string takes all that is written to it";
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n");
    writeln!(text, "{}", mesh.particles.len()).expect(TO_STRING);
    for (k, x) in mesh.particles.iter().enumerate() {
        writeln!(text, "{} {} {} {}", k + 1, x.x, x.y, x.z).expect(TO_STRING);
    }
    writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tets.len()).expect(TO_STRING);
    for (k, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|corner| corner + 1);
        writeln!(text, "{} 4 2 1 1 {a} {b} {c} {d}", k + 1).expect(TO_STRING);
    }
    text.push_str("$EndElements\n");
    text.into_bytes()
}
