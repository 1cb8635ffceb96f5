// Factorisations of matrices whose size is known at run time, compiled once: Eigen's take seconds in every file that
// names them. Matrices are real; A symmetric where a function says so.
#pragma once

#include <Eigen/Core>

namespace terrode {

// L of A = L L^T, A symmetric and positive definite (Cholesky). `positive` in place of a throw: false where A is not.
struct Cholesky {
  Eigen::MatrixXd lower;
  bool positive = false;
};
Cholesky cholesky(const Eigen::MatrixXd& A);

// x of A x = b, A symmetric and semidefinite, by L D L^T with pivoting; one column of x for each column of b.
Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& A, const Eigen::MatrixXd& b);

// x that makes |A x - b| least, by singular values, which are given too (the largest first).
struct LeastSquaresSolution {
  Eigen::VectorXd x, singular_values;
};
LeastSquaresSolution solve_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

// Orthonormal columns that span those of A (as many, A no wider than tall), by Householder reflections.
Eigen::MatrixXd orthonormal_columns(const Eigen::MatrixXd& A);

// A^-1 by LU with partial pivoting.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& A);

// A = V diag(values) V^T, A symmetric; values ascend.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& A);

// Eigenvalues of a square matrix, in no order.
Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& A);

}  // namespace terrode
