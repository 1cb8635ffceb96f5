#include "cli/commands.h"

int main(int argc, char** argv) { return terrode::cli::run(argc, argv); }
