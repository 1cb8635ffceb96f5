#include "core/linear_algebra.h"

#include <Eigen/Dense>

namespace terrode {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Cholesky cholesky(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> factor(A);
  return {factor.matrixL(), factor.info() == Eigen::Success};
}

MatrixXd solve_symmetric(const MatrixXd& A, const MatrixXd& b) { return A.ldlt().solve(b); }

LeastSquaresSolution solve_least_squares(const MatrixXd& A, const VectorXd& b) {
  const Eigen::JacobiSVD<MatrixXd> svd(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return {svd.solve(b), svd.singularValues()};
}

MatrixXd orthonormal_columns(const MatrixXd& A) {
  return Eigen::HouseholderQR<MatrixXd>(A).householderQ() * MatrixXd::Identity(A.rows(), A.cols());
}

MatrixXd inverse(const MatrixXd& A) { return A.inverse(); }

SymmetricEigen symmetric_eigen(const MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::VectorXcd eigenvalues(const MatrixXd& A) { return Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues(); }

}  // namespace terrode
