//! Robot descriptions: what is read, what is refused and how, and that what is written is the model that was fitted.

mod library;
mod random;
mod reading;
mod writing;

/// Robots as their makers describe them, with a base, a tip, and how many joints move between them.
const ROBOTS: [(&str, &str, &str, &str, usize); 5] = [
    ("panda", include_str!("urdf/robots/panda.urdf"), "panda_link0", "panda_link8", 7),
    ("panda-mukca", include_str!("urdf/robots/panda-mukca.urdf"), "panda_link0", "panda_hand_tcp", 7),
    ("ur10", include_str!("urdf/robots/ur10.urdf"), "base_link", "tool0", 6),
    ("tiago", include_str!("urdf/robots/tiago.urdf"), "base_footprint", "arm_tool_link", 8),
    ("gen3lite", include_str!("urdf/robots/gen3lite.urdf"), "kinova_base_link", "end_effector_link", 6),
];
