//! Which joint carries which: the tree of a robot's joints.
//!
//! Joint j carries link j + 1, and is itself carried by the link of its parent; link 0 is the base, which carries the joints that have
//! no parent. A joint moves its own link and the links of all joints that descend from it, and no other link. A parent comes before its
//! children, so that joints in order are joints from the base outwards. An arm is the tree in which the parent of joint j is joint
//! j − 1.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// The parents of a robot's joints. The default is an arm of however many joints.
///
/// ```
/// use body_schema_engine::kinematics::Tree;
///
/// // A trunk that carries two arms of two joints each.
/// let tree = Tree::new(vec![None, Some(0), Some(1), Some(0), Some(3)])?;
/// assert_eq!(tree.path(5).collect::<Vec<_>>(), [4, 3, 0]);
/// assert!(tree.moves(0, 5) && !tree.moves(1, 5));
/// # Ok::<(), body_schema_engine::kinematics::TreeError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Option<usize>>", into = "Vec<Option<usize>>")]
pub struct Tree {
    /// `None` for an arm.
    branches: Option<Arc<Branches>>,
}

#[derive(Debug, PartialEq, Eq)]
struct Branches {
    parents: Vec<Option<usize>>,
    /// Whether a joint moves a link, link by link.
    moves: Vec<bool>,
}

/// Why a list of parents is no tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TreeError {
    /// A joint's parent does not come before it.
    #[error("joint {joint} hangs on joint {parent} (counted from 0): put a parent before its children")]
    Order {
        /// The joint, counted from 0.
        joint: usize,
        /// Its parent as given.
        parent: usize,
    },
    /// There is not one parent for each joint.
    #[error("{joints} joints have {parents} parents: give one for each joint, and none for a joint on the base")]
    Count {
        /// How many joints there are.
        joints: usize,
        /// How many parents were given.
        parents: usize,
    },
    /// Something is fixed to a link that does not exist.
    #[error("link {link} does not exist: a robot of {joints} joints has the links 0 (the base) to {joints}")]
    Link {
        /// The link as given.
        link: usize,
        /// How many joints there are.
        joints: usize,
    },
}

impl Tree {
    /// The tree of these parents, one for each joint; `None` for a joint on the base.
    ///
    /// # Errors
    ///
    /// [`TreeError::Order`] if a parent does not come before its child.
    pub fn new(parents: Vec<Option<usize>>) -> Result<Self, TreeError> {
        for (joint, &parent) in parents.iter().enumerate() {
            if let Some(parent) = parent.filter(|parent| *parent >= joint) {
                return Err(TreeError::Order { joint, parent });
            }
        }
        if parents.iter().enumerate().all(|(joint, parent)| *parent == joint.checked_sub(1)) {
            return Ok(Self::default());
        }
        let count = parents.len();
        let mut moves = vec![false; (count + 1) * count];
        for (joint, parent) in parents.iter().enumerate() {
            let (before, own) = (parent.map_or(0, |parent| parent + 1), joint + 1);
            moves.copy_within(before * count..(before + 1) * count, own * count);
            moves[own * count + joint] = true;
        }
        Ok(Self { branches: Some(Arc::new(Branches { parents, moves })) })
    }

    /// Whether the tree is an arm: every joint hangs on the one before it.
    pub fn is_serial(&self) -> bool {
        self.branches.is_none()
    }

    /// The joint that carries a joint; `None` for one on the base.
    #[inline]
    pub fn parent(&self, joint: usize) -> Option<usize> {
        match &self.branches {
            None => joint.checked_sub(1),
            Some(branches) => branches.parents.get(joint).copied().flatten(),
        }
    }

    /// The link that carries a joint.
    #[inline]
    pub fn link_before(&self, joint: usize) -> usize {
        self.parent(joint).map_or(0, |parent| parent + 1)
    }

    /// Whether a joint moves a link.
    #[inline]
    pub fn moves(&self, joint: usize, link: usize) -> bool {
        match &self.branches {
            None => joint < link,
            Some(branches) => {
                joint < link && branches.moves.get(link * branches.parents.len() + joint).copied().unwrap_or(false)
            }
        }
    }

    /// The joints that move a link, from the link to the base.
    pub fn path(&self, link: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(link.checked_sub(1), |joint| self.parent(*joint))
    }
}

impl TryFrom<Vec<Option<usize>>> for Tree {
    type Error = TreeError;

    fn try_from(parents: Vec<Option<usize>>) -> Result<Self, TreeError> {
        Self::new(parents)
    }
}

impl From<Tree> for Vec<Option<usize>> {
    fn from(tree: Tree) -> Self {
        tree.branches.map_or_else(Self::new, |branches| branches.parents.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parent_comes_before_its_child() {
        for (parents, joint, parent) in
            [(vec![Some(0)], 0, 0), (vec![None, Some(2), None], 1, 2), (vec![None, Some(0), Some(7)], 2, 7)]
        {
            let error = Tree::new(parents).expect_err("no tree");
            assert_eq!(error, TreeError::Order { joint, parent });
            assert!(error.to_string().contains("before its children"), "{error}");
        }
    }

    #[test]
    fn only_branches_are_written() {
        let arm = Tree::new(vec![None, Some(0), Some(1)]).expect("a tree");
        assert!(arm.is_serial() && arm == Tree::default());
        let tree = Tree::new(vec![None, Some(0), Some(0), None]).expect("a tree");
        let written = serde_json::to_string(&tree).expect("JSON");
        assert_eq!(written, "[null,0,0,null]");
        assert_eq!(serde_json::from_str::<Tree>(&written).expect("a tree"), tree);
        assert!(serde_json::from_str::<Tree>("[1,null]").is_err());
        assert_eq!((tree.parent(2), tree.link_before(2), tree.link_before(3)), (Some(0), 1, 0));
        // What is beyond it moves nothing.
        assert!(!tree.moves(9, 10) && !tree.moves(0, 10) && tree.path(9).count() == 1);
    }
}
