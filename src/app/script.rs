//! Where the scripted tools of a scene are at each time.

use crate::geom::SurfaceMesh;
use crate::geom::ray::{first_hit, nearest_point};
use crate::scene::{Key, RestBox, ToolSection, ToolShapeName};
use crate::sim::{ToolAction, ToolInput, ToolShape};
use glam::Vec3;

/// The tools of a scene, with their key frames as places in metres.
#[derive(Clone, Debug, Default)]
pub struct Script {
    tools: Vec<ScriptedTool>,
}

#[derive(Clone, Debug)]
struct ScriptedTool {
    shape: ToolShape,
    friction: f32,
    keys: Vec<PlacedKey>,
    /// First touch of the surface at rest and the unit direction to it, if the tool has an approach.
    ray: Option<(Vec3, Vec3)>,
}

#[derive(Clone, Copy, Debug)]
struct PlacedKey {
    at_s: f32,
    position_m: Vec3,
    action: ToolAction,
}

impl Script {
    /// Places the key frames of `tools` on the body at rest.
    pub fn new(tools: &[ToolSection], mesh: &SurfaceMesh, rest: &RestBox) -> Self {
        let triangles = mesh.point_triangles();
        let tools = tools
            .iter()
            .map(|tool| {
                let radius_m = rest
                    .length(tool.radius_m, tool.radius_share)
                    .expect("a checked tool has a radius");
                let ray = tool.approach.map(|approach| {
                    let from = rest
                        .place(None, Some(approach.from_share))
                        .expect("a share was given");
                    let toward = rest
                        .place(None, Some(approach.toward_share))
                        .expect("a share was given");
                    approach_ray(from, toward, &mesh.points, &triangles)
                });
                ScriptedTool {
                    shape: match tool.shape {
                        ToolShapeName::Sphere => ToolShape::Sphere { radius_m },
                        ToolShapeName::Capsule => ToolShape::Capsule {
                            radius_m,
                            axis_m: tool
                                .axis_m
                                .or(tool.axis_share.map(|s| s * rest.longest_m()))
                                .expect("a checked capsule has an axis"),
                        },
                    },
                    friction: tool.friction,
                    ray,
                    keys: tool
                        .keys
                        .iter()
                        .map(|key| PlacedKey {
                            at_s: key.at_s,
                            position_m: place(key, rest, ray, radius_m),
                            action: key.action,
                        })
                        .collect(),
                }
            })
            .collect();
        Self { tools }
    }

    /// The tools as they are at `time_s`.
    pub fn at(&self, time_s: f32) -> Vec<ToolInput> {
        self.tools.iter().map(|tool| tool.at(time_s)).collect()
    }

    /// How deep the front of the first tool with an approach is below the surface at rest [m],
    /// negative above it; `None` if there is no such tool.
    pub fn depth_m(&self, time_s: f32) -> Option<f32> {
        self.tools.iter().find_map(|tool| {
            let (touch, direction) = tool.ray?;
            let way = tool.at(time_s).position_m - touch;
            Some(way.dot(direction) + tool.shape.radius_m())
        })
    }
}

impl ScriptedTool {
    fn at(&self, time_s: f32) -> ToolInput {
        let after = self.keys.partition_point(|key| key.at_s <= time_s);
        let key = self.keys[after.saturating_sub(1)];
        let position_m = match self.keys.get(after) {
            // A tool that rests is where it is, to the last bit.
            Some(next) if after > 0 && next.position_m != key.position_m => {
                let share = (time_s - key.at_s) / (next.at_s - key.at_s);
                key.position_m.lerp(next.position_m, share)
            }
            _ => key.position_m,
        };
        ToolInput {
            shape: self.shape,
            position_m,
            action: key.action,
            friction: self.friction,
        }
    }
}

/// First touch of the surface, and the unit direction of the approach.
///
/// A ray that misses, as one made for another organ may, is turned to the nearest point of the surface.
fn approach_ray(from: Vec3, toward: Vec3, points: &[Vec3], triangles: &[[u32; 3]]) -> (Vec3, Vec3) {
    let direction = (toward - from).normalize_or(Vec3::NEG_Z);
    match first_hit(from, direction, points, triangles) {
        Some(hit) => (from + hit.distance * direction, direction),
        None => {
            let touch = nearest_point(toward, points).map_or(toward, |i| points[i]);
            (touch, (touch - from).normalize_or(direction))
        }
    }
}

fn place(key: &Key, rest: &RestBox, ray: Option<(Vec3, Vec3)>, radius_m: f32) -> Vec3 {
    let shift = key.shift_share.unwrap_or(Vec3::ZERO) * rest.longest_m();
    let on_ray = rest.length(key.depth_m, key.depth_share).zip(ray);
    let place = match on_ray {
        // The front of the tool is a radius ahead of its middle.
        Some((depth, (touch, direction))) => touch + (depth - radius_m) * direction,
        None => rest
            .place(key.at_m, key.at_share)
            .expect("a checked key has a place"),
    };
    place + shift
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tool() -> ScriptedTool {
        let key = |at_s: f32, x: f32, action| PlacedKey {
            at_s,
            position_m: Vec3::new(x, 0.0, 0.0),
            action,
        };
        ScriptedTool {
            shape: ToolShape::Sphere { radius_m: 0.01 },
            friction: 0.0,
            ray: None,
            keys: vec![
                key(1.0, 0.0, ToolAction::Push),
                key(2.0, 1.0, ToolAction::Grab),
            ],
        }
    }

    #[test]
    fn a_tool_moves_evenly_between_its_keys_and_rests_outside_them() {
        for (time_s, x) in [(0.0, 0.0), (1.0, 0.0), (1.25, 0.25), (2.0, 1.0), (9.0, 1.0)] {
            assert_eq!(tool().at(time_s).position_m.x, x, "at {time_s} s");
        }
    }

    #[test]
    fn a_tool_does_what_its_last_key_says() {
        assert_eq!(tool().at(1.99).action, ToolAction::Push);
        assert_eq!(tool().at(2.0).action, ToolAction::Grab);
    }

    #[test]
    fn the_depth_is_that_of_the_front_below_the_first_touch() {
        // Moves along x, towards a surface that it meets at x = 0.31.
        let script = Script {
            tools: vec![
                tool(),
                ScriptedTool {
                    ray: Some((0.31 * Vec3::X, Vec3::X)),
                    ..tool()
                },
            ],
        };
        for (time_s, depth_m) in [(0.0, -0.3), (1.25, -0.05), (2.0, 0.7)] {
            let depth = script.depth_m(time_s).expect("a tool has an approach");
            assert!((depth - depth_m).abs() < 1e-6, "{depth} at {time_s} s");
        }
        let without = Script {
            tools: vec![tool()],
        };
        assert_eq!(without.depth_m(1.0), None);
    }

    #[test]
    fn an_approach_that_misses_is_turned_to_the_nearest_point() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let from = Vec3::new(5.0, 5.0, 5.0);
        let (touch, direction) =
            approach_ray(from, Vec3::new(4.0, 0.0, 5.0), &points, &[[0, 1, 2]]);
        assert_eq!(touch, Vec3::X);
        assert!((direction - (Vec3::X - from).normalize()).length() < 1e-6);
    }
}
