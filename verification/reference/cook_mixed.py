"""Cook's membrane near incompressibility, for the study `locking`: see README.md."""
# Cook's membrane: Q2 displacements, discontinuous P1 mean dilatation, neo-Hookean (Ciarlet), plane strain, load steps + Newton with line search
import numpy as np, scipy.sparse as sp, scipy.sparse.linalg as sl, sys
G=0.4225
def cook(nu,n,steps=8):
    Lam=2*G*nu/(1-2*nu)
    m=2*n+1
    xi=np.linspace(0,1,m)
    X=np.zeros((m,m,2))
    for i,a in enumerate(xi):
        for j,b in enumerate(xi):
            lo=44*a; hi=44+16*a
            X[i,j]=[48*a, lo+(hi-lo)*b]
    X=X.reshape(-1,2)
    num=lambda i,j:i*m+j
    el=np.array([[num(2*e+a,2*f+b) for a in range(3) for b in range(3)] for e in range(n) for f in range(n)])
    g1=np.sqrt(.6)*np.array([-1,0,1]); w1=np.array([5,8,5])/9
    def l(x): return np.array([x*(x-1)/2,1-x*x,x*(x+1)/2]),np.array([x-.5,-2*x,x+.5])
    E=len(el); dN=[];W=[];B=[]
    for i in range(3):
        for j in range(3):
            a,da=l(g1[i]); b,db=l(g1[j])
            d=np.stack([np.outer(da,b).ravel(),np.outer(a,db).ravel()],1)  #9x2
            Jm=np.einsum('eni,nk->eik',X[el],d); det=np.linalg.det(Jm)
            dN.append(np.einsum('nk,eki->eni',d,np.linalg.inv(Jm))); W.append(w1[i]*w1[j]*det)
            B.append([1,g1[i],g1[j]])
    dN=np.stack(dN,1); W=np.stack(W,1); B=np.array(B)  # E,9g,9n,2 ; E,9
    M=np.einsum('ga,eg,gb->eab',B,W,B); P=np.einsum('ga,eab,hb,eh->egh',B,np.linalg.inv(M),B,W) # theta_g = P_gh J_h
    ndof=2*len(X); dofs=(2*el[:,:,None]+np.arange(2)).reshape(E,18)
    fext=np.zeros(ndof); 
    for f in range(n):
        ids=[num(2*n,2*f+k) for k in range(3)]
        for k,wt in zip(ids,[1/6,4/6,1/6]): fext[2*k+1]+=wt*16/n*1/16.
    fext*=1.0  # 1 N/mm over 16 mm: traction 1/16 N/mm^2 per unit thickness
    free=np.ones(ndof,bool)
    for j in range(m): free[2*num(0,j)]=free[2*num(0,j)+1]=False
    I=np.eye(2)
    def kin(u):
        F=I+np.einsum('eni,egnk->egik',u.reshape(-1,2)[el],dN); J=np.linalg.det(F); return F,J
    def energy(u,lam):
        F,J=kin(u)
        th=np.einsum('egh,eh->eg',P,J)
        if J.min()<=0 or th.min()<=0: return np.inf
        return (W*(G/2*((F**2).sum((2,3))-2-2*np.log(J))+Lam/4*(th**2-1)-Lam/2*np.log(th))).sum()-lam*fext@u
    def grad(u,lam,tang=True):
        F,J=kin(u); th=np.einsum('egh,eh->eg',P,J)
        A=np.stack([np.stack([F[...,1,1],-F[...,1,0]],-1),np.stack([-F[...,0,1],F[...,0,0]],-1)],-2) # cof
        Fit=A/J[...,None,None]
        U1=Lam/2*(th-1/th); U2=Lam/2*(1+1/th**2)
        c=np.einsum('eg,eg,egh->eh',W,U1,P)
        Pk=G*(F-Fit)*W[...,None,None]+c[...,None,None]*A
        r=np.zeros(ndof); np.add.at(r,dofs.ravel(),np.einsum('egik,egnk->eni',Pk,dN).ravel())
        r-=lam*fext
        if not tang: return r
        g=np.einsum('egik,egnk->egni',Fit,dN)
        K=np.einsum('eg,egnk,egmk,ij->enimj',G*W,dN,dN,I)+np.einsum('eg,egnj,egmi->enimj',G*W,g,g)
        # J'' = J (g⊗g - g⊗g^T)
        K+=np.einsum('eg,egni,egmj->enimj',c*J,g,g)-np.einsum('eg,egnj,egmi->enimj',c*J,g,g)
        b=(J[...,None,None]*g).reshape(E,9,18)
        H=np.einsum('egh,eg,egk->ehk',P,W*U2,P)
        K=K.reshape(E,18,18)+np.einsum('eha,ehk,ekb->eab',b,H,b)
        Ks=sp.csr_matrix((K.ravel(),(np.repeat(dofs,18,1).ravel(),np.tile(dofs,(1,18)).ravel())),(ndof,ndof))
        return r,Ks
    u=np.zeros(ndof)
    for s in range(1,steps+1):
        lam=s/steps
        for it in range(60):
            r,K=grad(u,lam); nr=np.linalg.norm(r[free])
            if nr<1e-9*np.linalg.norm(fext): break
            d=np.zeros(ndof); d[free]=sl.spsolve(K[free][:,free].tocsc(),-r[free])
            t=1;e0=energy(u,lam);sl0=r[free]@d[free]
            while True:
                un=u+t*d
                if np.isfinite(energy(un,lam)):
                    if np.linalg.norm(grad(un,lam,False)[free])<nr or energy(un,lam)<=e0+1e-4*t*sl0+1e-13*abs(e0): break
                t/=2
                if t<1e-6: print('ls');break
            u=un
        else: print('not converged',nr)
    tip=num(2*n,n)
    return u[2*tip:2*tip+2]
for nu in [0.3,0.49,0.499,0.4999]:
    print(nu,[(n,tuple(cook(nu,n).round(4))) for n in (4,8,16,32)],flush=True)
