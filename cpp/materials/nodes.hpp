// The nodes of pattern programs. One entry of the table in nodes.cpp is one node.
#pragma once

#include "materials/program.hpp"

namespace usdmlt {

// What a node sees besides its inputs.
struct NodeContext {
    const Program& program;
    const std::vector<Texture>& textures;
    const MeshPoint& point;
    int width;
    uint32_t data;
};

struct Node {
    const char* name;
    int inputs;
    Value (*evaluate)(const Value in[], const NodeContext& context);
    bool varies = false;  // depends on the point even where the inputs do not
};

const Node* find_node(const std::string& name);  // null: there is none

// The names of all nodes, for tests.
std::vector<std::string> node_names();

}  // namespace usdmlt
